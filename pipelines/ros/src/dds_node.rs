//! A ROS 2 node over DDS, with its publishers and subscribers. Topics have a prefix, types their names in DDS, and the
//! hash of a type is among the user data of its endpoints.

use super::dds_graph::{Graph, NAMES_TOPIC, TOPIC_PREFIX};
use super::dds_names::{self, Form, NodeName, TYPE};
use super::discovery::node_identity::NodeIdentity;
use super::key_expression::{NO_HASH, Topic, type_in_keys};
use super::liveliness::Entity;
use super::qos::Qos;
use super::rtps::{
    EndpointData, EntityId, Guid, LAST_DOMAIN, Participant, Policies, Prefix, Reach, Reading, Sample, Writing,
};
use gridweave_runtime::stage::StageError;
use std::collections::BTreeSet;
use std::net::Ipv4Addr;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A node with a participant of its own.
pub(crate) struct DdsNode {
    own: Arc<OwnNode>,
    _names: Reading,
    graph: Arc<Graph>,
    participant: Participant,
}

/// The node as others see it.
struct OwnNode {
    participant: Guid,
    name: NodeName,
    endpoints: Mutex<BTreeSet<Guid>>,
    names: Writing,
    /// The names for nodes of Humble, once there is one.
    humble_names: OnceLock<Writing>,
}

impl DdsNode {
    /// Joins a domain as a node.
    ///
    /// # Errors
    /// There is no such domain, or the system refuses the sockets.
    pub(crate) fn start(
        domain: u32,
        name: &NodeIdentity,
        reach: Reach,
        peers: &[Ipv4Addr],
    ) -> Result<Self, StageError> {
        let doing = "join the DDS network";
        if domain > LAST_DOMAIN {
            let error = StageError::new(doing, format!("there is no domain {domain}"));
            return Err(error.with_help(format!("domains of DDS are 0 to {LAST_DOMAIN}")));
        }
        let participant = Participant::start(domain, [&name.node, &name.enclave], reach, peers)
            .map_err(|error| StageError::new(doing, error).with_help("`middleware = \"zenoh\"` does without DDS"))?;
        let graph = Graph::new(domain);
        participant.watch(Box::new(Arc::clone(&graph)));
        let own = Arc::new(OwnNode {
            participant: Guid { prefix: participant.prefix(), entity: EntityId::PARTICIPANT },
            name: NodeName { namespace: "/".to_owned(), name: name.node.clone() },
            endpoints: Mutex::default(),
            names: participant.write_to_hash(names(Form::Iron)),
            humble_names: OnceLock::new(),
        });
        own.change(|_| {});
        // What is read must not keep up what is written.
        let (of_others, for_others) = (Arc::clone(&graph), Arc::downgrade(&own));
        let reading = participant.read_from(names(Form::Iron), false, move |sample| {
            let form = of_others.note_names(&sample.payload);
            if let (Some(own), Some(form)) = (for_others.upgrade(), form) {
                own.serve(sample.writer.prefix, form);
            }
        });
        Ok(Self { own, _names: reading, graph, participant })
    }

    /// The name of its participant.
    pub(crate) fn session_name(&self) -> String {
        self.participant.prefix().to_string()
    }

    /// Calls `call` with each entity of others that is there or comes, and again when it is gone.
    pub(crate) fn watch(&self, call: impl Fn(Entity, bool) + Send + Sync + 'static) {
        self.graph.watch(Box::new(call));
    }

    /// Problems that have come up since the last call.
    pub(crate) fn take_problems(&self) -> Vec<String> {
        self.graph.take_problems()
    }

    /// Creates a publisher of a topic.
    pub(crate) fn publish(&self, topic: &Topic, qos: Qos) -> DdsPublisher {
        let writing = self.participant.write_to(of_topic(topic, qos));
        let of_node = OfNode::new(&self.own, writing.guid());
        DdsPublisher { writing, _of_node: of_node }
    }

    /// Subscribes to a topic: calls `call` with each message, first with those that its publishers have kept.
    pub(crate) fn subscribe(
        &self,
        topic: &Topic,
        qos: Qos,
        call: impl Fn(Sample) + Send + Sync + 'static,
    ) -> DdsSubscriber {
        let reading = self.participant.read_from(of_topic(topic, qos), true, call);
        let of_node = OfNode::new(&self.own, reading.guid());
        let mismatches = OfGraph { graph: Arc::clone(&self.graph), endpoint: reading.guid() };
        DdsSubscriber { _reading: reading, _of_node: of_node, _mismatches: mismatches }
    }
}

impl OwnNode {
    fn change(&self, change: impl FnOnce(&mut BTreeSet<Guid>)) {
        let mut endpoints = self.endpoints.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut endpoints);
        self.names.write(&self.message(Form::Iron, &endpoints));
        if let Some(names) = self.humble_names.get() {
            names.write(&self.message(Form::Humble, &endpoints));
        }
    }

    /// Publishes the names to a participant in the form in which it publishes its own: not all state it by the hash.
    fn serve(&self, participant: Prefix, form: Form) {
        let endpoints = self.endpoints.lock().unwrap_or_else(PoisonError::into_inner);
        let writing = match form {
            Form::Iron => &self.names,
            Form::Humble => self.humble_names.get_or_init(|| {
                let writing = self.names.beside_to_hash(names(Form::Humble));
                writing.write(&self.message(Form::Humble, &endpoints));
                writing
            }),
        };
        if writing.serve(participant) {
            writing.write(&self.message(form, &endpoints));
        }
    }

    fn message(&self, form: Form, endpoints: &BTreeSet<Guid>) -> Vec<u8> {
        let all: Vec<Guid> = endpoints.iter().copied().collect();
        dds_names::message(form, self.participant, &self.name, &all)
    }
}

/// The endpoint of names.
fn names(form: Form) -> EndpointData {
    endpoint(NAMES_TOPIC, TYPE, form.type_hash(), Policies::new(true, true, Some(1)))
}

/// An endpoint of the node, until it is dropped.
struct OfNode {
    node: Arc<OwnNode>,
    endpoint: Guid,
}

impl OfNode {
    fn new(node: &Arc<OwnNode>, endpoint: Guid) -> Self {
        node.change(|endpoints| {
            endpoints.insert(endpoint);
        });
        Self { node: Arc::clone(node), endpoint }
    }
}

impl Drop for OfNode {
    fn drop(&mut self) {
        self.node.change(|endpoints| {
            endpoints.remove(&self.endpoint);
        });
    }
}

/// What an endpoint does not match, until it is dropped.
struct OfGraph {
    graph: Arc<Graph>,
    endpoint: Guid,
}

impl Drop for OfGraph {
    fn drop(&mut self) {
        self.graph.forget(self.endpoint);
    }
}

/// A publisher of a topic.
pub(crate) struct DdsPublisher {
    writing: Writing,
    _of_node: OfNode,
}

impl DdsPublisher {
    /// Publishes an encoded message.
    pub(crate) fn send(&self, message: &[u8]) {
        self.writing.write(message);
    }
}

/// A subscriber of a topic, until it is dropped.
pub(crate) struct DdsSubscriber {
    _reading: Reading,
    _of_node: OfNode,
    // After the reading, of which none comes any more then.
    _mismatches: OfGraph,
}

fn of_topic(topic: &Topic, qos: Qos) -> EndpointData {
    let depth = qos.depth.map(|depth| u32::try_from(depth).unwrap_or(u32::MAX));
    let type_hash = Some(topic.type_hash.as_str()).filter(|hash| *hash != NO_HASH);
    let policies = Policies::new(qos.is_reliable, qos.is_latched, depth);
    endpoint(&format!("{TOPIC_PREFIX}{}", topic.name), &type_in_keys(&topic.ros_type), type_hash, policies)
}

/// An endpoint that is to be made.
fn endpoint(topic: &str, type_name: &str, type_hash: Option<&str>, policies: Policies) -> EndpointData {
    EndpointData {
        guid: Guid::default(),
        topic: topic.to_owned(),
        type_name: type_name.to_owned(),
        type_hash: type_hash.map(str::to_owned),
        policies,
        addresses: Vec::new(),
        enclave: String::new(),
    }
}

//! What nodes there are on DDS, and what they publish and subscribe to: endpoints as their participants announce them,
//! with the names of the nodes that they belong to, which each participant publishes in one message.

use super::dds_names::{Form, NodeName, nodes};
use super::key_expression::{NO_HASH, Topic, type_of_key};
use super::liveliness::{Entity, Kind};
use super::qos::Qos;
use super::rtps::{EndpointData, Guid, Mismatch, Prefix, Watch};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The topic of the names of nodes.
pub(crate) const NAMES_TOPIC: &str = "ros_discovery_info";
/// The prefix of all topics of ROS.
pub(crate) const TOPIC_PREFIX: &str = "rt";
/// The maximum wait for the name of an endpoint's node.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long a mismatch lasts before it is reported: a subscriber here may subscribe again with what all offer, once
/// it is known whose the endpoint is.
const MISMATCH_PATIENCE: Duration = Duration::from_secs(2);

/// The number of digits of a type's hash that are shown.
const HASH_DIGITS: usize = 8;

/// Called with an entity that is there, or is no more.
type OnEntity = Box<dyn Fn(Entity, bool) + Send + Sync>;

/// The nodes of others.
pub(crate) struct Graph {
    domain: u32,
    seen: Mutex<SeenTopic>,
    watchers: Mutex<Vec<OnEntity>>,
    /// Problems that were not taken yet.
    problems: Mutex<Vec<String>>,
}

#[derive(Default)]
struct SeenTopic {
    /// The nodes of endpoints.
    names: BTreeMap<Guid, NodeName>,
    /// The participants that publish such names.
    participants_with_names: BTreeSet<Prefix>,
    /// Endpoints whose node is not known yet.
    nameless: BTreeMap<Guid, (Instant, EndpointData)>,
    /// Entities of which watchers were notified.
    entities: BTreeMap<Guid, Entity>,
    mismatches: Vec<(Instant, Mismatch)>,
    reported_mismatches: BTreeSet<String>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Graph {
    pub(crate) fn new(domain: u32) -> Arc<Self> {
        Arc::new(Self { domain, seen: Mutex::default(), watchers: Mutex::default(), problems: Mutex::default() })
    }

    /// Calls `call` with each entity that is there or comes, and again when it is gone.
    pub(crate) fn watch(&self, call: OnEntity) {
        let mut watchers = lock(&self.watchers);
        let present: Vec<Entity> = lock(&self.seen).entities.values().cloned().collect();
        present.into_iter().for_each(|entity| call(entity, true));
        watchers.push(call);
    }

    /// Problems that have come up since the last call.
    pub(crate) fn take_problems(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.problems))
    }

    /// An endpoint here is no more, and what it did not match does not count.
    pub(crate) fn forget(&self, here: Guid) {
        lock(&self.seen).mismatches.retain(|(_, mismatch)| mismatch.here.guid != here);
    }

    /// Records the names of a participant's nodes. Gives the form of the message; `None` if it is broken.
    pub(crate) fn note_names(&self, message: &[u8]) -> Option<Form> {
        let (nodes, form) = nodes(message)?;
        let mut seen = lock(&self.seen);
        for (name, endpoints) in nodes {
            seen.names.extend(endpoints.into_iter().map(|endpoint| (endpoint, name.clone())));
        }
        drop(seen);
        self.settle();
        Some(form)
    }

    /// Reports endpoints whose node is known, or was waited for long enough.
    fn settle(&self) {
        let now = Instant::now();
        let mut seen = lock(&self.seen);
        let SeenTopic { names, nameless, entities, mismatches, reported_mismatches, .. } = &mut *seen;
        let is_ready = |since: Instant, guid: &Guid| names.contains_key(guid) || now.duration_since(since) >= PATIENCE;
        let mut new = Vec::new();
        nameless.retain(|guid, (since, endpoint)| {
            let is_ready = is_ready(*since, guid);
            if let Some(entity) = is_ready.then(|| entity(self.domain, endpoint, names.get(guid))).flatten() {
                entities.insert(*guid, entity.clone());
                new.push(entity);
            }
            !is_ready
        });
        let mut problems = Vec::new();
        mismatches.retain(|(since, mismatch)| {
            let is_ready = now.duration_since(*since) >= MISMATCH_PATIENCE;
            if is_ready {
                problems.push(problem(mismatch, names.get(&mismatch.there.guid)));
            }
            !is_ready
        });
        problems.retain(|text| reported_mismatches.insert(text.clone()));
        drop(seen);
        new.into_iter().for_each(|entity| self.notify(&entity, true));
        for text in problems {
            tracing::warn!("{text}");
            lock(&self.problems).push(text);
        }
    }

    fn notify(&self, entity: &Entity, is_there: bool) {
        lock(&self.watchers).iter().for_each(|watcher| watcher(entity.clone(), is_there));
    }
}

impl Watch for Arc<Graph> {
    fn endpoint(&self, endpoint: &EndpointData, is_there: bool) {
        let guid = endpoint.guid;
        let mut seen = lock(&self.seen);
        if endpoint.topic == NAMES_TOPIC {
            if is_there {
                seen.participants_with_names.insert(guid.prefix);
            }
            return;
        }
        if is_there {
            // Who publishes no names is no node of ROS, and is not waited for.
            let waits = seen.participants_with_names.contains(&guid.prefix);
            let since = if waits { Some(Instant::now()) } else { Instant::now().checked_sub(PATIENCE) };
            seen.nameless.insert(guid, (since.unwrap_or_else(Instant::now), endpoint.clone()));
            drop(seen);
            self.settle();
            return;
        }
        seen.nameless.remove(&guid);
        seen.mismatches.retain(|(_, mismatch)| mismatch.there.guid != guid);
        seen.names.remove(&guid);
        let gone = seen.entities.remove(&guid);
        drop(seen);
        if let Some(entity) = gone {
            self.notify(&entity, false);
        }
    }

    fn mismatch(&self, mismatch: &Mismatch) {
        lock(&self.seen).mismatches.push((Instant::now(), mismatch.clone()));
    }

    fn tick(&self) {
        self.settle();
    }
}

/// The topic of an endpoint as ROS names it; `None` if it is none of ROS.
fn ros_topic(endpoint: &EndpointData) -> Option<Topic> {
    let name = endpoint.topic.strip_prefix(TOPIC_PREFIX).filter(|name| name.starts_with('/'))?.to_owned();
    let type_hash = endpoint.type_hash.clone().unwrap_or_else(|| NO_HASH.to_owned());
    Some(Topic { name, ros_type: type_of_key(&endpoint.type_name)?, type_hash })
}

fn entity(domain: u32, endpoint: &EndpointData, name: Option<&NodeName>) -> Option<Entity> {
    let topic = ros_topic(endpoint)?;
    let policies = &endpoint.policies;
    let depth = policies.depth.map(|depth| depth as usize);
    let qos = Qos { is_reliable: policies.is_reliable, is_latched: policies.is_latched(), depth };
    let is_writer = endpoint.guid.entity.is_writer();
    let NodeName { namespace, name } = name.cloned().unwrap_or_default();
    Some(Entity {
        domain,
        session: endpoint.guid.prefix.to_string(),
        node_number: 0,
        number: u32::from_be_bytes(endpoint.guid.entity.0),
        enclave: endpoint.enclave.clone(),
        namespace,
        node: name,
        kind: if is_writer { Kind::Publisher(topic, qos) } else { Kind::Subscriber(topic, qos) },
    })
}

/// The warning about a local and a remote endpoint that do not match.
fn problem(mismatch: &Mismatch, name: Option<&NodeName>) -> String {
    let Mismatch { here, there, policies } = mismatch;
    let topic = here.topic.strip_prefix(TOPIC_PREFIX).unwrap_or(&here.topic);
    let who = match name {
        Some(name) => name.to_string(),
        None => format!("the participant {}", there.guid.prefix),
    };
    let (does, here_does) =
        if here.guid.entity.is_writer() { ("subscribes to", "published") } else { ("publishes", "subscribed to") };
    if !policies.is_empty() {
        return format!(
            "{who} {does} `{topic}` with the QoS {}, and here it is {here_does} with {}: {} cannot match, and the messages do not \
             arrive",
            there.policies,
            here.policies,
            policies.join(" and ")
        );
    }
    let is_one_name = there.type_name == here.type_name;
    let of = |endpoint: &EndpointData| {
        let name = type_of_key(&endpoint.type_name).unwrap_or_else(|| endpoint.type_name.clone());
        let hash = endpoint.type_hash.as_ref().filter(|_| is_one_name);
        hash.map_or(name.clone(), |hash| format!("{name} ({})", short_hash(hash)))
    };
    format!(
        "{who} {does} `{topic}` with the type {}, and here it is {here_does} with {}: they do not understand each other",
        of(there),
        of(here)
    )
}

/// The first digits of a type's hash, which are enough to distinguish two definitions: `RIHS01_df668c74`.
pub(crate) fn short_hash(hash: &str) -> &str {
    let end = hash.find('_').map_or(0, |at| at + 1) + HASH_DIGITS;
    hash.get(..end).unwrap_or(hash)
}

#[cfg(test)]
mod tests {
    use super::super::rtps::Policies;
    use super::*;
    use std::sync::mpsc::channel;

    fn endpoint(number: u16, topic: &str) -> EndpointData {
        EndpointData {
            guid: Guid { prefix: Prefix([7; 12]), entity: super::super::rtps::EntityId::writer(number) },
            topic: topic.into(),
            type_name: "nav_msgs::msg::dds_::OccupancyGrid_".into(),
            type_hash: None,
            policies: Policies::new(true, true, Some(1)),
            addresses: Vec::new(),
            enclave: "/".into(),
        }
    }

    #[test]
    fn an_endpoint_is_reported_once_its_node_is_known_and_at_once_if_it_has_none() {
        let graph = Graph::new(0);
        let (sender, reported) = channel();
        graph.watch(Box::new(move |entity, is_there| sender.send((entity, is_there)).unwrap()));
        graph.endpoint(&endpoint(1, "rt/robot1/map"), true);
        let (entity, _) = reported.try_recv().unwrap();
        assert_eq!((entity.full_node_name().as_str(), entity.session.len()), ("/", 24));
        graph.endpoint(&endpoint(2, NAMES_TOPIC), true);
        graph.endpoint(&endpoint(3, "rt/robot2/map"), true);
        assert!(reported.try_recv().is_err(), "its name is waited for");
        let name = NodeName { namespace: "/robot2".into(), name: "slam_toolbox".into() };
        let message = super::super::dds_names::message(Form::Iron, Guid::default(), &name, &[endpoint(3, "").guid]);
        graph.note_names(&message);
        let (entity, is_there) = reported.try_recv().unwrap();
        assert_eq!((entity.full_node_name().as_str(), is_there), ("/robot2/slam_toolbox", true));
        graph.endpoint(&endpoint(3, "rt/robot2/map"), false);
        assert_eq!(reported.try_recv().unwrap(), (entity, false));
        graph.endpoint(&endpoint(4, "rr/robot2/set_parametersReply"), true);
        assert!(reported.try_recv().is_err(), "a service is no topic");
    }

    /// Lets the patience with all mismatches end.
    fn wait_out(graph: &Arc<Graph>) {
        for (since, _) in &mut lock(&graph.seen).mismatches {
            *since = since.checked_sub(MISMATCH_PATIENCE).unwrap();
        }
        graph.tick();
    }

    #[test]
    fn a_mismatch_of_an_endpoint_that_is_gone_is_not_reported() {
        let graph = Graph::new(0);
        let (here, there) = (endpoint(1, "rt/map"), endpoint(2, "rt/map"));
        let mismatch = || Mismatch { here: here.clone(), there: there.clone(), policies: vec!["reliability"] };
        graph.mismatch(&mismatch());
        graph.forget(here.guid);
        wait_out(&graph);
        graph.mismatch(&mismatch());
        graph.endpoint(&there, false);
        wait_out(&graph);
        assert_eq!(graph.take_problems(), Vec::<String>::new());
    }

    #[test]
    fn types_are_reported_with_their_hashes_only_if_their_names_are_equal() {
        let hash = |digit: &str| Some(format!("RIHS01_{}", digit.repeat(64)));
        let here = EndpointData { type_hash: hash("a"), ..endpoint(1, "rt/map") };
        let there = EndpointData { type_hash: hash("b"), ..endpoint(2, "rt/map") };
        let problem = |here: &EndpointData| {
            problem(&Mismatch { here: here.clone(), there: there.clone(), policies: Vec::new() }, None)
        };
        let text = problem(&here);
        assert!(text.contains("OccupancyGrid (RIHS01_bbbbbbbb), and") && text.contains("(RIHS01_aaaaaaaa):"), "{text}");
        let text = problem(&EndpointData { type_name: "std_msgs::msg::dds_::String_".into(), ..here });
        assert!(text.contains("std_msgs/msg/String:") && !text.contains("RIHS01"), "{text}");
    }

    #[test]
    fn a_mismatch_is_reported_once_with_the_settings_of_both_sides() {
        let graph = Graph::new(0);
        let (here, there) = (endpoint(1, "rt/map"), endpoint(2, "rt/map"));
        let here = EndpointData { policies: Policies::new(false, false, Some(5)), ..here };
        let name = NodeName { namespace: "/".into(), name: "rviz".into() };
        graph.note_names(&super::super::dds_names::message(Form::Iron, Guid::default(), &name, &[there.guid]));
        for _ in 0..2 {
            graph.mismatch(&Mismatch { here: here.clone(), there: there.clone(), policies: vec!["reliability"] });
            graph.tick();
            assert!(graph.take_problems().is_empty(), "a subscriber may subscribe again");
        }
        wait_out(&graph);
        let problems = graph.take_problems();
        let [problem] = problems.as_slice() else { panic!("{problems:?}") };
        for words in ["/rviz subscribes", "`/map`", "reliable, transient local", "best effort, volatile", "reliability"]
        {
            assert!(problem.contains(words), "{problem}");
        }
        assert!(graph.take_problems().is_empty());
    }
}

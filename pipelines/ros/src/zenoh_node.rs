//! A ROS 2 node over Zenoh, with its publishers and subscribers.

use super::attachment::Attachment;
use super::connection::Connection;
use super::discovery::node_identity::NodeIdentity;
use super::key_expression::Topic;
use super::liveliness::{Entity, Kind};
use super::qos::Qos;
use super::zenoh_without_hash::{PublisherWithoutHash, without_hash};
use gridweave_bridge::clock::nanoseconds_now;
use gridweave_bridge::zenoh_session::{in_words, is_connected};
use gridweave_runtime::stage::StageError;
use std::time::Duration;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriber, AdvancedSubscriberBuilderExt, CacheConfig,
    HistoryConfig, MissDetectionConfig, RecoveryConfig,
};

/// The period at which a transient-local publisher sends its sequence number after a new message, so that subscribers
/// detect missed messages; the same as in `rmw_zenoh`.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// The timeout of a request for the history of a publisher.
const HISTORY_TIMEOUT: Duration = Duration::from_secs(600);

/// A node with its own session.
pub(crate) struct ZenohNode {
    session: Session,
    identity: Entity,
    /// The number of its next publisher or subscriber.
    next_number: u32,
    _token: LivelinessToken,
    connection: Connection,
}

impl ZenohNode {
    /// Joins the network as a node.
    ///
    /// # Errors
    /// The network cannot be joined.
    pub(crate) fn start(connection: Connection, domain: u32, name: &NodeIdentity) -> Result<Self, StageError> {
        let session = connection.open()?;
        let identity = Entity {
            domain,
            session: session.zid().to_string(),
            node_number: 0,
            number: 0,
            enclave: name.enclave.clone(),
            namespace: "/".to_owned(),
            node: name.node.clone(),
            kind: Kind::Node,
        };
        let token = declare(&session, &identity)?;
        Ok(Self { session, identity, next_number: 1, _token: token, connection })
    }

    /// The id of its session.
    pub(crate) fn session_name(&self) -> &str {
        &self.identity.session
    }

    /// The addresses of routers, if it is connected to neither a router nor another program.
    pub(crate) fn looks_for_router(&self) -> Option<String> {
        (!is_connected(&self.session)).then(|| self.connection.routers())
    }

    fn entity(&mut self, kind: Kind) -> Entity {
        let number = self.next_number;
        self.next_number += 1;
        Entity { number, kind, ..self.identity.clone() }
    }

    /// Calls `call` with every present and future entity of the domain, and again when it disappears.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn watch(&self, call: impl Fn(Entity, bool) + Send + Sync + 'static) -> Result<(), StageError> {
        let callback = move |sample: Sample| {
            if let Ok(entity) = sample.key_expr().as_str().parse() {
                call(entity, sample.kind() == SampleKind::Put);
            }
        };
        let watched = self.session.liveliness().declare_subscriber(Entity::all(self.identity.domain)).history(true);
        let watched = watched.callback(callback).background().wait();
        watched.map_err(|error| StageError::new("discover ROS 2 programs", in_words(&error)))
    }

    /// Creates a publisher of a topic.
    ///
    /// # Errors
    /// The topic has an invalid name, or the session has failed.
    pub(crate) fn publish(&mut self, topic: Topic, qos: Qos) -> Result<ZenohPublisher, StageError> {
        let name = topic.name.clone();
        let failed = |error: zenoh::Error| StageError::new(format!("publish `{name}`"), in_words(&error));
        let publisher = self.declare_publisher(&topic, qos).map_err(failed)?;
        let (domain, old) = (self.identity.domain, without_hash(&topic));
        let humble = self.declare_publisher(&old, qos).map_err(failed)?;
        let humble = PublisherWithoutHash::new(&self.session, domain, &old, qos.is_latched, humble).map_err(failed)?;
        let entity = self.entity(Kind::Publisher(topic, qos));
        let token = declare(&self.session, &entity)?;
        Ok(ZenohPublisher { publisher, humble, gid: entity.gid(), sequence: 0, name, _token: token })
    }

    fn declare_publisher(&self, topic: &Topic, qos: Qos) -> zenoh::Result<AdvancedPublisher<'static>> {
        let key = topic.key_expression(self.identity.domain);
        let mut publisher = self.session.declare_publisher(key).congestion_control(CongestionControl::Block).advanced();
        if qos.is_latched {
            publisher = publisher
                .cache(CacheConfig::default().max_samples(qos.depth.unwrap_or(usize::MAX)))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
                .publisher_detection();
        }
        publisher.wait()
    }

    /// Subscribes to a topic: calls `call` with each message, first with those that its publishers have retained.
    ///
    /// # Errors
    /// The topic has an invalid name, or the session has failed.
    pub(crate) fn subscribe(
        &mut self,
        topic: Topic,
        qos: Qos,
        call: impl Fn(Sample) + Send + Sync + 'static,
    ) -> Result<ZenohSubscriber, StageError> {
        let (name, key) = (topic.name.clone(), topic.key_expression(self.identity.domain));
        let failed = |error: zenoh::Error| StageError::new(format!("subscribe to `{name}`"), in_words(&error));
        let mut subscriber = self.session.declare_subscriber(key).callback(call).advanced();
        if qos.is_latched {
            let history = HistoryConfig::default().detect_late_publishers();
            subscriber = subscriber
                .history(history.max_samples(qos.depth.unwrap_or(usize::MAX)))
                .recovery(RecoveryConfig::default().heartbeat())
                .query_timeout(HISTORY_TIMEOUT)
                .subscriber_detection();
        }
        let subscriber = subscriber.wait().map_err(failed)?;
        let entity = self.entity(Kind::Subscriber(topic, qos));
        Ok(ZenohSubscriber { _subscriber: subscriber, _token: declare(&self.session, &entity)? })
    }
}

/// A publisher of a topic.
pub(crate) struct ZenohPublisher {
    publisher: AdvancedPublisher<'static>,
    humble: PublisherWithoutHash,
    gid: [u8; 16],
    sequence: i64,
    name: String,
    _token: LivelinessToken,
}

impl ZenohPublisher {
    /// Publishes an encoded message.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn send(&mut self, message: &[u8]) -> Result<(), StageError> {
        self.sequence += 1;
        let attachment = Attachment { sequence: self.sequence, source_time: nanoseconds_now(), gid: self.gid };
        let message = [ZBytes::from(message), ZBytes::from(attachment.to_bytes().as_slice())];
        let [content, attachment] = message.clone();
        let sent = self.publisher.put(content).attachment(attachment).wait();
        sent.and_then(|()| self.humble.send(message))
            .map_err(|error| StageError::new(format!("publish `{}`", self.name), in_words(&error)))
    }
}

/// A subscriber of a topic, until it is dropped.
pub(crate) struct ZenohSubscriber {
    _subscriber: AdvancedSubscriber<()>,
    _token: LivelinessToken,
}

fn declare(session: &Session, entity: &Entity) -> Result<LivelinessToken, StageError> {
    let token = session.liveliness().declare_token(entity.to_string()).wait();
    token.map_err(|error| StageError::new(format!("announce {}", entity.full_node_name()), in_words(&error)))
}

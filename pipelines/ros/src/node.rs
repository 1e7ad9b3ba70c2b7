//! A ROS 2 node: what tells others that it is there, and what it sends and hears.

use super::attachment::Attachment;
use super::connection::{Connection, in_words, is_connected};
use super::key_expression::Topic;
use super::liveliness::{Entity, Kind};
use super::qos::Qos;
use gridweave_runtime::stage::StageError;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriber, AdvancedSubscriberBuilderExt, CacheConfig,
    HistoryConfig, MissDetectionConfig, RecoveryConfig,
};

/// So often a publisher that keeps its last messages says how many it has sent, once it has sent another: by that a subscriber
/// sees that it has missed one. As `rmw_zenoh` has it.
const HEARTBEAT: Duration = Duration::from_millis(500);
/// So long an answer with the messages of before may take.
const HISTORY_TIMEOUT: Duration = Duration::from_secs(600);

/// A node in a session of its own.
pub(crate) struct Node {
    session: Session,
    identity: Entity,
    /// The numbers of its publishers and subscribers.
    next_number: u32,
    _token: LivelinessToken,
    connection: Connection,
}

impl Node {
    /// Joins the network as the node that the parameters name, or else with the name of the stage.
    ///
    /// # Errors
    /// The network cannot be joined.
    pub(crate) fn start(connection: Connection, stage: &str) -> Result<Self, StageError> {
        let domain = connection.domain()?;
        let session = connection.open()?;
        let identity = Entity {
            domain,
            session: session.zid().to_string(),
            node_number: 0,
            number: 0,
            namespace: "/".to_owned(),
            node: connection.node.clone().unwrap_or_else(|| format!("gridweave_{}", usable(stage))),
            kind: Kind::Node,
        };
        let token = declare(&session, &identity)?;
        Ok(Self { session, identity, next_number: 1, _token: token, connection })
    }

    /// The name of its session.
    pub(crate) fn session_name(&self) -> &str {
        &self.identity.session
    }

    /// Where a router is looked for, if there is neither a router nor another program that it is connected to.
    pub(crate) fn looks_for_router(&self) -> Option<String> {
        (!is_connected(&self.session)).then(|| self.connection.routers())
    }

    fn entity(&mut self, kind: Kind) -> Entity {
        let number = self.next_number;
        self.next_number += 1;
        Entity { number, kind, ..self.identity.clone() }
    }

    /// Calls for everything in the domain that is there and that comes, and again when it goes.
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
        watched.map_err(|error| StageError::new("watch which ROS 2 programs there are", in_words(&error)))
    }

    /// A publisher of a topic.
    ///
    /// # Errors
    /// The topic cannot be named so, or the session has failed.
    pub(crate) fn publish(&mut self, topic: Topic, qos: Qos) -> Result<Publisher, StageError> {
        let (name, key) = (topic.name.clone(), topic.key_expression(self.identity.domain));
        let failed = |error: zenoh::Error| StageError::new(format!("publish `{name}`"), in_words(&error));
        let mut publisher = self.session.declare_publisher(key).congestion_control(CongestionControl::Block).advanced();
        if qos.is_latched {
            publisher = publisher
                .cache(CacheConfig::default().max_samples(qos.depth.unwrap_or(usize::MAX)))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
                .publisher_detection();
        }
        let publisher = publisher.wait().map_err(failed)?;
        let entity = self.entity(Kind::Publisher(topic, qos));
        let token = declare(&self.session, &entity)?;
        Ok(Publisher { publisher, gid: entity.gid(), sequence: 0, name, _token: token })
    }

    /// Calls with each message of a topic, first with those that its publishers have kept.
    ///
    /// # Errors
    /// The topic cannot be named so, or the session has failed.
    pub(crate) fn subscribe(
        &mut self,
        topic: Topic,
        qos: Qos,
        call: impl Fn(Sample) + Send + Sync + 'static,
    ) -> Result<Subscriber, StageError> {
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
        Ok(Subscriber { _subscriber: subscriber, _token: declare(&self.session, &entity)? })
    }
}

/// A topic that is published.
pub(crate) struct Publisher {
    publisher: AdvancedPublisher<'static>,
    gid: [u8; 16],
    sequence: i64,
    name: String,
    _token: LivelinessToken,
}

impl Publisher {
    /// Sends a message, encoded.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn send(&mut self, message: &[u8]) -> Result<(), StageError> {
        self.sequence += 1;
        let attachment = Attachment { sequence: self.sequence, source_time: nanoseconds_now(), gid: self.gid };
        let sent = self.publisher.put(message).attachment(attachment.to_bytes().as_slice()).wait();
        sent.map_err(|error| StageError::new(format!("publish `{}`", self.name), in_words(&error)))
    }
}

/// A topic that is heard. That ends when it is dropped.
pub(crate) struct Subscriber {
    _subscriber: AdvancedSubscriber<()>,
    _token: LivelinessToken,
}

/// The time of this machine, nanoseconds since the Unix epoch. It is read where messages come from or go to other programs, and
/// nowhere else.
pub(crate) fn nanoseconds_now() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

fn declare(session: &Session, entity: &Entity) -> Result<LivelinessToken, StageError> {
    let token = session.liveliness().declare_token(entity.to_string()).wait();
    token.map_err(|error| StageError::new(format!("tell of {}", entity.full_node_name()), in_words(&error)))
}

/// The name of a stage as part of one of a node.
fn usable(stage: &str) -> String {
    stage.replace(|c: char| !c.is_ascii_alphanumeric(), "_")
}

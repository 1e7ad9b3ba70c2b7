//! What nodes of ROS 2 do over Zenoh, without the stages under test: `rmw_zenoh_cpp` declares what is declared here.

use gridweave_ros::attachment::Attachment;
use gridweave_ros::key_expression::Topic;
use gridweave_ros::liveliness::{Entity, Kind};
use gridweave_ros::qos::Qos;
use std::net::TcpListener;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use zenoh::liveliness::LivelinessToken;
use zenoh::{Config, Session, Wait};
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriber, AdvancedSubscriberBuilderExt, CacheConfig,
    HistoryConfig, MissDetectionConfig, RecoveryConfig,
};

/// What takes longer hangs.
pub(crate) const WATCHDOG: Duration = Duration::from_secs(60);

/// A topic of messages of a type that is known.
pub(crate) fn topic(name: &str, ros_type: &str) -> Topic {
    Topic::known(name, ros_type).unwrap()
}

fn session(mode: &str, connect: &[&str], listen: &[&str]) -> Session {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", serde_json::to_string(mode).unwrap()),
        ("connect/endpoints", serde_json::to_string(connect).unwrap()),
        ("listen/endpoints", serde_json::to_string(listen).unwrap()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("timestamping/enabled", "true".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

/// A router on this machine, as `rmw_zenohd` is one.
pub(crate) struct Router {
    endpoint: String,
    _session: Option<Session>,
}

impl Router {
    pub(crate) fn start() -> Self {
        let router = Self::nowhere();
        let session = session("router", &[], &[&router.endpoint]);
        Self { _session: Some(session), ..router }
    }

    /// Where none is.
    pub(crate) fn nowhere() -> Self {
        // Free until this test takes it.
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self { endpoint: format!("tcp/127.0.0.1:{port}"), _session: None }
    }

    pub(crate) fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The parameters of a stage that connects to it.
    pub(crate) fn parameters(&self) -> String {
        format!("middleware = \"zenoh\"\ndomain = 0\nconnect = [\"{}\"]\nlisten = [\"tcp/127.0.0.1:0\"]", self.endpoint)
    }
}

/// A program with one node.
pub(crate) struct Robot {
    session: Session,
    node: Entity,
    next_number: AtomicU32,
    _token: LivelinessToken,
}

impl Robot {
    pub(crate) fn start(router: &Router, name: &str) -> Self {
        let session = session("peer", &[router.endpoint()], &["tcp/127.0.0.1:0"]);
        let node = Entity {
            domain: 0,
            session: session.zid().to_string(),
            node_number: 0,
            number: 0,
            enclave: "/".into(),
            namespace: "/".into(),
            node: name.into(),
            kind: Kind::Node,
        };
        let token = session.liveliness().declare_token(node.to_string()).wait().unwrap();
        Self { session, node, next_number: AtomicU32::new(10), _token: token }
    }

    fn entity(&self, kind: Kind) -> Entity {
        Entity { number: self.next_number.fetch_add(1, Ordering::Relaxed), kind, ..self.node.clone() }
    }

    pub(crate) fn publish(&self, topic: &Topic, qos: Qos) -> Sender {
        let mut publisher = self.session.declare_publisher(topic.key_expression(0)).advanced();
        if qos.is_latched {
            publisher = publisher
                .cache(CacheConfig::default().max_samples(qos.depth.unwrap()))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(Duration::from_millis(500)))
                .publisher_detection();
        }
        let publisher = publisher.wait().unwrap();
        let entity = self.entity(Kind::Publisher(topic.clone(), qos));
        let token = self.session.liveliness().declare_token(entity.to_string()).wait().unwrap();
        Sender { publisher, gid: entity.gid(), sequence: 0, _token: token }
    }

    pub(crate) fn subscribe(&self, topic: &Topic, qos: Qos) -> TopicSubscriber {
        let (sender, messages) = channel();
        let (subscriber, token) = self.subscribe_to(topic, qos, sender);
        TopicSubscriber { messages, _subscribers: vec![subscriber], _tokens: vec![token] }
    }

    /// Hears two topics, whose messages come in the order in which they have arrived.
    pub(crate) fn subscribe_both(&self, topics: [(&Topic, Qos); 2]) -> TopicSubscriber {
        let (sender, messages) = channel();
        let both = topics.map(|(topic, qos)| self.subscribe_to(topic, qos, sender.clone()));
        let (subscribers, tokens) = both.into_iter().unzip();
        TopicSubscriber { messages, _subscribers: subscribers, _tokens: tokens }
    }

    fn subscribe_to(
        &self,
        topic: &Topic,
        qos: Qos,
        sender: std::sync::mpsc::Sender<(Option<Attachment>, Vec<u8>)>,
    ) -> (AdvancedSubscriber<()>, LivelinessToken) {
        let call = move |sample: zenoh::sample::Sample| {
            let attachment = sample.attachment().and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
            sender.send((attachment, sample.payload().to_bytes().into_owned())).ok();
        };
        let mut subscriber = self.session.declare_subscriber(topic.key_expression(0)).callback(call).advanced();
        if qos.is_latched {
            subscriber = subscriber
                .history(HistoryConfig::default().detect_late_publishers().max_samples(qos.depth.unwrap()))
                .recovery(RecoveryConfig::default().heartbeat())
                .subscriber_detection();
        }
        let subscriber = subscriber.wait().unwrap();
        let entity = self.entity(Kind::Subscriber(topic.clone(), qos));
        let token = self.session.liveliness().declare_token(entity.to_string()).wait().unwrap();
        (subscriber, token)
    }

    /// Waits until there is something whose token ends so.
    #[track_caller]
    pub(crate) fn wait_for_token(&self, end: &str) {
        let until = Instant::now() + WATCHDOG;
        loop {
            let replies = self.session.liveliness().get(Entity::all(0)).timeout(WATCHDOG).wait().unwrap();
            let tokens: Vec<String> =
                replies.iter().map(|reply| reply.into_result().unwrap().key_expr().to_string()).collect();
            if tokens.iter().any(|token| token.ends_with(end)) {
                return;
            }
            assert!(Instant::now() < until, "no {end} in {tokens:?}");
        }
    }
}

pub(crate) struct Sender {
    publisher: AdvancedPublisher<'static>,
    gid: [u8; 16],
    sequence: i64,
    _token: LivelinessToken,
}

impl Sender {
    pub(crate) fn send(&mut self, message: &[u8]) {
        self.sequence += 1;
        let attachment = Attachment { sequence: self.sequence, source_time: 1, gid: self.gid };
        self.publisher.put(message).attachment(attachment.to_bytes().as_slice()).wait().unwrap();
    }

    /// Whether somebody hears it: what is sent before is kept for nobody.
    pub(crate) fn is_heard(&self) -> bool {
        self.publisher.matching_status().wait().unwrap().matching()
    }
}

pub(crate) struct TopicSubscriber {
    messages: Receiver<(Option<Attachment>, Vec<u8>)>,
    _subscribers: Vec<AdvancedSubscriber<()>>,
    _tokens: Vec<LivelinessToken>,
}

impl TopicSubscriber {
    /// The next message, which has an attachment.
    pub(crate) fn next(&self) -> Vec<u8> {
        let (attachment, message) = self.messages.recv_timeout(WATCHDOG).expect("nothing has come");
        assert!(attachment.is_some_and(|attachment| attachment.sequence > 0), "{attachment:?}");
        message
    }

    /// The next message, if it has come.
    pub(crate) fn try_next(&self) -> Option<Vec<u8>> {
        self.messages.try_recv().ok().map(|(_, message)| message)
    }
}

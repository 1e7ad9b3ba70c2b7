//! The stage `ros_source`: takes what robots publish into a live pipeline.

use super::attachment::Attachment;
use super::definitions::Definitions;
use super::inbox::{Event, Inbox};
use super::key_expression::{NO_HASH, Topic};
use super::liveliness::{Entity, Kind};
use super::node::{Node, Subscriber, nanoseconds_now};
use super::qos::Qos;
use super::source_parameters::SourceParameters;
use gridweave_logs::qos;
use gridweave_logs::source::{LiveMessage, LiveRouter, RobotMessages};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::stage::{Context, Output, Source, StageError, StageKind};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};
use zenoh::sample::Sample;

/// So many events are handled at a time.
const BATCH: usize = 64;
/// The time that a router may take to answer before a warning.
const PATIENCE: Duration = Duration::from_secs(3);

/// The kind `ros_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "ros_source",
        "Takes what robots publish in ROS 2 into a live pipeline while it runs, over Zenoh as `rmw_zenoh_cpp` speaks it: maps and \
         their updates, poses, transforms and readings of tags, and scans of robots without a map, on the topics that `[robots]` \
         names. Robots come and go as they like",
        RosSource::new,
    )
    .live_only()
}

/// Takes what robots publish.
pub struct RosSource {
    node: Node,
    inbox: Arc<Inbox<Sample>>,
    router: LiveRouter,
    definitions: Definitions,
    keep_last: usize,
    /// The topics that were ever seen.
    topics: BTreeMap<Topic, Seen>,
    /// Publishers of scans of robots that may yet publish a map, and since when they are known.
    waiting_scans: Vec<(Instant, Entity)>,
    wait_for_map: Duration,
    update_period: Duration,
    discovery_timeout: Duration,
    /// Whether another program has published anything.
    has_publishers: bool,
    /// When the maps with updates were sent last.
    updates_sent: Instant,
    /// Those of the topics that are heard.
    subscribers: BTreeMap<Topic, Subscriber>,
    /// Warnings that were given.
    warned: BTreeSet<String>,
    /// Whether a router or another program has answered, and since when that has been so.
    is_connected: bool,
    changed: Instant,
    log_time: u64,
}

/// A topic that was seen.
struct Seen {
    /// Its number in the router.
    number: usize,
    qos: Qos,
    /// Those that publish it.
    publishers: BTreeSet<Entity>,
}

impl RosSource {
    /// Joins the network.
    ///
    /// # Errors
    /// It cannot be joined.
    pub fn new(parameters: SourceParameters, context: &Context) -> Result<Self, StageError> {
        let node = Node::start(parameters.connection(), &context.stage)?;
        let duration = |seconds| Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let inbox = Arc::new(Inbox::default());
        let events = Arc::clone(&inbox);
        node.watch(move |entity, is_there| events.push(Event::Entity(entity, is_there), 0))?;
        Ok(Self {
            node,
            inbox,
            router: LiveRouter::new(context.robots.clone(), parameters.also, parameters.map_values),
            definitions: Definitions::new(&parameters.definitions),
            keep_last: parameters.keep_last,
            topics: BTreeMap::new(),
            waiting_scans: Vec::new(),
            wait_for_map: duration(parameters.wait_for_map),
            update_period: duration(parameters.update_period),
            discovery_timeout: duration(parameters.discovery_timeout),
            has_publishers: false,
            updates_sent: Instant::now(),
            subscribers: BTreeMap::new(),
            warned: BTreeSet::new(),
            is_connected: false,
            changed: Instant::now(),
            log_time: 0,
        })
    }

    /// A program has come or gone.
    fn note_entity(
        &mut self,
        entity: Entity,
        is_there: bool,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Kind::Publisher(topic, qos) = entity.kind.clone() else { return Ok(()) };
        if entity.session == self.node.session_name() {
            return Ok(());
        }
        self.has_publishers |= is_there;
        if !is_there {
            self.waiting_scans.retain(|(_, waiting)| *waiting != entity);
            if let Some(seen) = self.topics.get_mut(&topic) {
                seen.publishers.remove(&entity);
            }
            return Ok(());
        }
        if !self.topics.contains_key(&topic) {
            let channel = self.channel(&topic, qos);
            if self.router.scanning_robot(&channel).is_some() {
                if output.takes_scans() {
                    self.waiting_scans.push((Instant::now(), entity));
                    return Ok(());
                }
                if !self.router.is_asked_for(&channel) {
                    return Ok(());
                }
            }
        }
        self.add_publisher(topic, qos, entity, output)
    }

    /// Takes up the topics with scans of robots that had time enough to publish a map.
    fn end_waiting(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let has_waited = |since: &Instant| since.elapsed() >= self.wait_for_map;
        let (ready, waiting) =
            std::mem::take(&mut self.waiting_scans).into_iter().partition(|(since, _)| has_waited(since));
        self.waiting_scans = waiting;
        for (_, entity) in ready {
            let Kind::Publisher(topic, qos) = entity.kind.clone() else { continue };
            self.add_publisher(topic, qos, entity, output)?;
        }
        Ok(())
    }

    /// Takes up what publishes a topic.
    fn add_publisher(
        &mut self,
        topic: Topic,
        qos: Qos,
        entity: Entity,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let number = match self.topics.get_mut(&topic) {
            Some(seen) => {
                seen.publishers.insert(entity);
                seen.number
            }
            None => {
                let number = self.router.add(self.channel(&topic, qos));
                let seen = Seen { number, qos, publishers: BTreeSet::from([entity]) };
                self.topics.insert(topic.clone(), seen);
                number
            }
        };
        self.check_publishers(&topic.name, number, output);
        self.subscribe(output)
    }

    /// Subscribes to all topics that are of use and can be read, and to no others.
    fn subscribe(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.leave_topics();
        let mut wrong = Vec::new();
        for (topic, seen) in &self.topics {
            let number = seen.number;
            if let Some(mismatch) = self.router.mismatch(number) {
                wrong.push(mismatch);
            }
            if !self.router.is_of_use(number) {
                continue;
            }
            if self.subscribers.contains_key(topic) {
                continue;
            }
            let is_other = |here: &String| *here != topic.type_hash && topic.type_hash != NO_HASH;
            if let Some(here) = self.definitions.hash(topic).filter(is_other) {
                wrong.push(format!(
                    "`{}` is published with another definition of {} than the one known here ({} there, {here} here): its messages \
                     are not taken",
                    topic.name, topic.ros_type, topic.type_hash
                ));
                continue;
            }
            let is_map = self.router.is_map(number);
            // The last map is all that counts.
            let depth = if is_map { 1 } else { seen.qos.depth.unwrap_or(self.keep_last).max(self.keep_last) };
            let inbox = Arc::clone(&self.inbox);
            let call = move |message: Sample| {
                inbox.push(Event::Message { topic: number, message, arrived: nanoseconds_now() }, depth);
            };
            let qos = Qos { depth: if is_map { Some(1) } else { seen.qos.depth }, ..seen.qos };
            let subscriber = self.node.subscribe(topic.clone(), qos, call)?;
            self.subscribers.insert(topic.clone(), subscriber);
            tracing::info!("takes messages of {} on `{}`", topic.ros_type, topic.name);
        }
        wrong.into_iter().for_each(|wrong| self.warn_once(wrong, output));
        Ok(())
    }

    /// Hears no more of topics that are of no use any longer, as another one has taken their place.
    fn leave_topics(&mut self) {
        let (topics, router) = (&self.topics, &self.router);
        let is_left = |topic: &&Topic| topics.get(*topic).is_none_or(|seen| !router.is_of_use(seen.number));
        let left: Vec<Topic> = self.subscribers.keys().filter(is_left).cloned().collect();
        for topic in left {
            self.subscribers.remove(&topic);
            let channel = self.channel(&topic, Qos::reliable(1));
            match self.router.scanning_robot(&channel) {
                Some(robot) => {
                    tracing::warn!("takes no more scans on `{}`: {robot} publishes a map after all", topic.name)
                }
                None => tracing::info!("takes no more messages of {} on `{}`", topic.ros_type, topic.name),
            }
        }
    }

    /// Two programs that publish the map or the pose of one robot are two robots of one name.
    fn check_publishers(&mut self, name: &str, number: usize, output: &Output<RobotMessages>) {
        if !self.router.is_of_one_robot(number) {
            return;
        }
        let of_name = self.topics.iter().filter(|(topic, _)| topic.name == name);
        let publishers: Vec<&Entity> = of_name.flat_map(|(_, seen)| &seen.publishers).collect();
        if publishers.len() > 1 {
            let nodes: Vec<String> = publishers
                .iter()
                .map(|entity| format!("{} in the session {}", entity.full_node_name(), entity.session))
                .collect();
            let text = format!(
                "`{name}` is published by {} programs at once ({}): are there two robots of one name? What they say of it is mixed up",
                publishers.len(),
                nodes.join(", ")
            );
            tracing::warn!("{text}");
            output.warn(text);
        }
    }

    /// Warns at once, and counts the warning, but only the first time.
    fn warn_once(&mut self, text: String, output: &Output<RobotMessages>) {
        if self.warned.insert(text.clone()) {
            tracing::warn!("{text}");
            output.warn(text);
        }
    }

    /// The channel of a topic in a log.
    fn channel(&self, topic: &Topic, qos: Qos) -> Channel {
        let schema = self.definitions.text(topic).unwrap_or_default();
        let encoding = if schema.is_empty() { "" } else { "ros2msg" };
        Channel {
            topic: topic.name.clone(),
            message_encoding: "cdr".to_owned(),
            schema_name: topic.ros_type.clone(),
            schema_encoding: encoding.to_owned(),
            schema: schema.into_bytes(),
            metadata: qos::offered(qos.is_latched),
        }
    }

    fn take_message(
        &mut self,
        number: usize,
        sample: &Sample,
        arrived: i64,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        // The clock of the machine may be set back, and what is sent may not.
        self.log_time = self.log_time.max(u64::try_from(arrived).unwrap_or_default());
        output.set_log_time(LogTime(self.log_time));
        let attachment = sample.attachment().and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
        if attachment.is_none() {
            output.count("messages without an attachment", 1);
        }
        let sent = attachment.and_then(|attachment| u64::try_from(attachment.source_time).ok());
        let sequence = attachment.map_or(0, |attachment| attachment.sequence as u32);
        let data = sample.payload().to_bytes();
        let message = LiveMessage { sequence, publish_time: sent.unwrap_or(self.log_time), data: &data };
        self.router.send(number, message, output)
    }

    /// Warns of a router that does not answer, and of a domain in which nobody publishes.
    fn check_connection(&mut self, output: &Output<RobotMessages>) {
        if self.has_publishers {
            return;
        }
        match self.node.looks_for_router() {
            None if !self.is_connected => {
                (self.is_connected, self.changed) = (true, Instant::now());
                tracing::info!("connected");
            }
            None if self.changed.elapsed() > self.discovery_timeout => {
                let text = format!(
                    "connected, but nobody publishes in the domain {}: robots on Fast DDS or Cyclone DDS are not heard, start their \
                     nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp; or is their ROS_DOMAIN_ID another one?",
                    self.node.domain()
                );
                self.warn_once(text, output);
            }
            Some(routers) if !self.is_connected && self.changed.elapsed() > PATIENCE => {
                let text = format!(
                    "no Zenoh router answers at {routers}: start one with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or name it in `connect`. \
                     It is looked for until it answers"
                );
                self.warn_once(text, output);
            }
            _ => {}
        }
    }
}

impl Source for RosSource {
    type Outputs = RobotMessages;

    fn wait(&mut self, longest: Duration) {
        self.inbox.wait(longest);
    }

    fn next(&mut self, output: &Output<RobotMessages>) -> Result<bool, StageError> {
        self.check_connection(output);
        self.end_waiting(output)?;
        for _ in 0..BATCH {
            match self.inbox.take() {
                None => break,
                Some(Event::Entity(entity, is_there)) => self.note_entity(entity, is_there, output)?,
                Some(Event::Message { topic, message, arrived }) => {
                    self.take_message(topic, &message, arrived, output)?;
                }
            }
        }
        if self.updates_sent.elapsed() >= self.update_period {
            self.updates_sent = Instant::now();
            self.router.send_updated_maps(output)?;
        }
        let dropped = self.inbox.take_dropped();
        if dropped > 0 {
            output.count("messages that were dropped because the pipeline does not keep up", dropped);
        }
        Ok(true)
    }

    fn finish(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.router.send_updated_maps(output)
    }
}

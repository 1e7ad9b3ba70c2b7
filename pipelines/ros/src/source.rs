//! The stage `ros_source`: takes what robots publish into a live pipeline.

use super::dds_graph::short_hash;
use super::definitions::Definitions;
use super::discovery::duplicate_publisher_warning;
use super::discovery::no_robot_warning::NoRobotWarning;
use super::discovery::node_identity::{NodeIdentity, Owner};
use super::discovery::topics::{OfferedTopic, SeenTopic};
use super::inbox::{Event, Inbox};
use super::key_expression::{NO_HASH, Topic};
use super::liveliness::{Entity, Kind};
use super::middleware::Middleware;
use super::node::{Node, Received, Subscriber};
use super::qos::Qos;
use super::source_parameters::SourceParameters;
use gridweave_bridge::clock::nanoseconds_now;
use gridweave_logs::qos;
use gridweave_logs::source::{LiveMessage, LiveRouter, RobotMessages, RobotReading};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use gridweave_runtime::stage::{Context, Output, RobotTopics, Source, StageError, StageKind, match_robot};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The number of events that are handled at a time.
const BATCH: usize = 64;

/// The kind `ros_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "ros_source",
        "Takes what robots publish in ROS 2 into a live pipeline while it runs, over DDS (Fast DDS, Cyclone DDS) and over Zenoh as \
         `rmw_zenoh_cpp` speaks it: maps and their updates, poses, transforms and readings of tags, and scans of robots without a map, on the topics that `[robots]` \
         names. Robots come and go as they like",
        RosSource::new,
    )
    .live_only()
}

/// Takes what robots publish.
pub struct RosSource {
    node: Node,
    inbox: Arc<Inbox<Received>>,
    router: LiveRouter,
    definitions: Definitions,
    keep_last: usize,
    /// The topics that were ever seen.
    topics: BTreeMap<OfferedTopic, SeenTopic>,
    /// Publishers of scans of robots that may yet publish a map, and since when they are known.
    waiting_scans: Vec<(Instant, Middleware, Entity)>,
    wait_for_map: Duration,
    update_period: Duration,
    robots: RobotTopics,
    /// The identifiers on Zenoh of publishers of Gridweave.
    left_out: BTreeSet<[u8; 16]>,
    no_robot_warning: NoRobotWarning,
    /// When the maps with updates were sent last.
    updates_sent: Instant,
    /// The subscribers of the received topics.
    subscribers: BTreeMap<OfferedTopic, Subscriber>,
    /// Warnings that were given.
    warned: BTreeSet<String>,
    log_time: u64,
}

impl RosSource {
    /// Joins the network.
    ///
    /// # Errors
    /// It cannot be joined.
    pub fn new(parameters: SourceParameters, context: &Context) -> Result<Self, StageError> {
        let name = NodeIdentity::of_stage(context, parameters.node.as_ref());
        let node = Node::start(parameters.connection(), name)?;
        let duration = |seconds| Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let inbox = Arc::new(Inbox::default());
        let events = Arc::clone(&inbox);
        let reading =
            RobotReading { map_values: parameters.map_values, lidars: parameters.lidars, ..Default::default() };
        node.watch(move |on, entity, is_there| events.push(Event::Entity(on, Box::new(entity), is_there), 0))?;
        Ok(Self {
            node,
            inbox,
            router: LiveRouter::new(context.robots.clone(), parameters.also, reading),
            definitions: Definitions::new(&parameters.definitions),
            keep_last: parameters.keep_last,
            topics: BTreeMap::new(),
            waiting_scans: Vec::new(),
            wait_for_map: duration(parameters.wait_for_map),
            update_period: duration(parameters.update_period),
            robots: context.robots.clone(),
            left_out: BTreeSet::new(),
            no_robot_warning: NoRobotWarning::new(duration(parameters.discovery_timeout)),
            updates_sent: Instant::now(),
            subscribers: BTreeMap::new(),
            warned: BTreeSet::new(),
            log_time: 0,
        })
    }

    /// A program has come or gone.
    fn note_entity(
        &mut self,
        middleware: Middleware,
        entity: Entity,
        is_there: bool,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Kind::Publisher(topic, qos) = entity.kind.clone() else { return Ok(()) };
        if self.node.session_names().contains(&entity.session) {
            return Ok(());
        }
        let owner = self.node.name().owner(&entity);
        self.no_robot_warning.note(middleware, entity.clone(), owner, is_there);
        if owner != Owner::Other {
            match is_there {
                true => self.left_out.insert(entity.gid()),
                false => self.left_out.remove(&entity.gid()),
            };
            let is_merged_map =
                topic.ros_type == OccupancyGrid::NAME && match_robot(&self.robots.map, &topic.name).is_some();
            if is_there && is_merged_map && owner == Owner::OtherRun {
                let (name, node) = (&topic.name, entity.full_node_name());
                let text = format!(
                    "`{name}` is a map that another run of Gridweave publishes, by its node {node}: it is left out. If it is to be \
                     merged, set `as_robot` in that stage"
                );
                self.warn_once(text, output);
            }
            return Ok(());
        }
        let offered = OfferedTopic { topic, middleware };
        if !is_there {
            self.waiting_scans.retain(|(_, _, waiting)| *waiting != entity);
            if let Some(seen) = self.topics.get_mut(&offered) {
                seen.publishers.remove(&entity);
                // Another middleware may have the topic, too.
                return self.subscribe(output);
            }
            return Ok(());
        }
        if !self.topics.contains_key(&offered) {
            let channel = self.channel(&offered.topic, qos);
            if self.router.scanning_robot(&channel).is_some() {
                if output.takes_scans() {
                    self.waiting_scans.push((Instant::now(), middleware, entity));
                    return Ok(());
                }
                if !self.router.is_asked_for(&channel) {
                    return Ok(());
                }
            }
        }
        self.add_publisher(offered, qos, entity, output)
    }

    /// Takes up the topics with scans of robots that had time enough to publish a map.
    fn end_waiting(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let has_waited = |since: &Instant| since.elapsed() >= self.wait_for_map;
        let (ready, waiting) =
            std::mem::take(&mut self.waiting_scans).into_iter().partition(|(since, ..)| has_waited(since));
        self.waiting_scans = waiting;
        for (_, middleware, entity) in ready {
            let Kind::Publisher(topic, qos) = entity.kind.clone() else { continue };
            self.add_publisher(OfferedTopic { topic, middleware }, qos, entity, output)?;
        }
        Ok(())
    }

    /// Takes up what publishes a topic.
    fn add_publisher(
        &mut self,
        offered: OfferedTopic,
        qos: Qos,
        entity: Entity,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let number = match self.topics.get_mut(&offered) {
            Some(seen) => {
                seen.publishers.insert(entity);
                let qos = seen.offered_by_all();
                // On DDS a publisher that offers less than what is requested does not match.
                if offered.middleware == Middleware::Dds && seen.qos != qos {
                    self.subscribers.remove(&offered);
                }
                seen.qos = qos;
                seen.number
            }
            None => {
                let number = self.router.add(self.channel(&offered.topic, qos));
                let seen = SeenTopic { number, qos, publishers: BTreeSet::from([entity]) };
                self.topics.insert(offered.clone(), seen);
                number
            }
        };
        self.check_publishers(&offered, number, output);
        self.subscribe(output)
    }

    /// Subscribes to all topics that are of use and can be read, and to no others.
    fn subscribe(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.leave_topics();
        let mut wrong = Vec::new();
        for (offered, seen) in &self.topics {
            let (topic, number) = (&offered.topic, seen.number);
            if let Some(mismatch) = self.router.mismatch(number) {
                wrong.push(mismatch);
            }
            if !self.router.is_of_use(number) {
                continue;
            }
            if self.subscribers.contains_key(offered) {
                continue;
            }
            if let Some(other) = self.on_another_middleware(offered) {
                if self.topics.get(&other).is_some_and(|seen| !seen.publishers.is_empty()) {
                    wrong.push(format!(
                        "`{}` is published over {} and over {}: it is heard over {} alone",
                        topic.name, offered.middleware, other.middleware, other.middleware
                    ));
                    continue;
                }
                self.subscribers.remove(&other);
            }
            let is_other = |here: &String| *here != topic.type_hash && topic.type_hash != NO_HASH;
            if let Some(here) = self.definitions.hash(topic).filter(is_other) {
                wrong.push(format!(
                    "`{}` is published with another definition of {} than the one known here ({} there, {} here): its messages \
                     are not taken",
                    topic.name,
                    topic.ros_type,
                    short_hash(&topic.type_hash),
                    short_hash(&here)
                ));
                continue;
            }
            let is_map = self.router.is_map(number);
            // The last map is all that counts.
            let depth = if is_map { 1 } else { seen.qos.depth.unwrap_or(self.keep_last).max(self.keep_last) };
            let inbox = Arc::clone(&self.inbox);
            let call = move |message: Received| {
                inbox.push(Event::Message { topic: number, message, arrived: nanoseconds_now() }, depth);
            };
            let qos = Qos { depth: if is_map { Some(1) } else { seen.qos.depth }, ..seen.qos };
            let subscriber = self.node.subscribe(offered.middleware, topic.clone(), qos, call)?;
            self.subscribers.insert(offered.clone(), subscriber);
            tracing::info!("takes messages of {} on `{}` over {}", topic.ros_type, topic.name, offered.middleware);
        }
        wrong.into_iter().for_each(|wrong| self.warn_once(wrong, output));
        Ok(())
    }

    /// The same topic on another middleware, if it is received there.
    fn on_another_middleware(&self, offered: &OfferedTopic) -> Option<OfferedTopic> {
        let is_other =
            |other: &&OfferedTopic| other.topic.name == offered.topic.name && other.middleware != offered.middleware;
        self.subscribers.keys().find(is_other).cloned()
    }

    /// Hears no more of topics that are of no use any longer, as another one has taken their place.
    fn leave_topics(&mut self) {
        let (topics, router) = (&self.topics, &self.router);
        let is_left = |offered: &&OfferedTopic| topics.get(*offered).is_none_or(|seen| !router.is_of_use(seen.number));
        let left: Vec<OfferedTopic> = self.subscribers.keys().filter(is_left).cloned().collect();
        for offered in left {
            self.subscribers.remove(&offered);
            let topic = offered.topic;
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
    fn check_publishers(&mut self, offered: &OfferedTopic, number: usize, output: &Output<RobotMessages>) {
        if !self.router.is_of_one_robot(number) {
            return;
        }
        let name = offered.topic.name.as_str();
        let is_same = |other: &OfferedTopic| other.topic.name == name && other.middleware == offered.middleware;
        let of_name = self.topics.iter().filter(|(other, _)| is_same(other));
        let publishers: Vec<&Entity> = of_name.flat_map(|(_, seen)| &seen.publishers).collect();
        if publishers.len() > 1 {
            output.warn(duplicate_publisher_warning::warning(name, &publishers));
        }
    }

    /// Warns, but only the first time.
    fn warn_once(&mut self, text: String, output: &Output<RobotMessages>) {
        if self.warned.insert(text.clone()) {
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
        message: &Received,
        arrived: i64,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if message.zenoh_publisher().is_some_and(|publisher| self.left_out.contains(&publisher)) {
            return Ok(());
        }
        // The clock of the machine may be set back, and what is sent may not.
        self.log_time = self.log_time.max(u64::try_from(arrived).unwrap_or_default());
        output.set_log_time(LogTime(self.log_time));
        let sent = message.sent();
        if sent.is_none() {
            output.count("messages without an attachment", 1);
        }
        let (sequence, data) = (sent.map_or(0, |sent| sent.sequence), message.content());
        let publish_time = sent.and_then(|sent| sent.time).unwrap_or(self.log_time);
        let message = LiveMessage { sequence, publish_time, data: &data };
        self.router.send(number, message, output)
    }

    /// Warns of a domain without publishers, and of errors of other nodes.
    fn check_network(&mut self, output: &Output<RobotMessages>) {
        // They were logged already.
        self.node.take_problems().into_iter().for_each(|problem| output.warn_logged(problem));
        let hears_any = !self.subscribers.is_empty() || !self.waiting_scans.is_empty();
        let texts = [
            self.no_robot_warning.warning(&self.node),
            self.no_robot_warning.misfit(&self.robots, [hears_any, output.takes_scans()]),
        ];
        texts.into_iter().flatten().for_each(|text| self.warn_once(text, output));
    }
}

impl Source for RosSource {
    type Outputs = RobotMessages;

    fn wait(&mut self, longest: Duration) {
        self.inbox.wait(longest);
    }

    fn next(&mut self, output: &Output<RobotMessages>) -> Result<bool, StageError> {
        self.check_network(output);
        self.end_waiting(output)?;
        for _ in 0..BATCH {
            match self.inbox.take() {
                None => break,
                Some(Event::Entity(on, entity, is_there)) => self.note_entity(on, *entity, is_there, output)?,
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

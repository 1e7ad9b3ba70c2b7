//! The stage `ros_sink`: publishes results as a ROS 2 node.

use super::connection::{Connection, LISTEN, ROUTER};
use super::discovery::node_identity::NodeIdentity;
use super::discovery_range::DiscoveryRange;
use super::key_expression::Topic;
use super::map_topics::{MapTopics, Sent};
use super::middleware::Middlewares;
use super::node::{Node, Publisher};
use super::other_runs::OtherRuns;
use super::published_frames::{Change, PublishedFrames};
use super::qos::Qos;
use super::robot_trees::{RobotTrees, in_robot_tree};
use gridweave_logs::names::TopicRename;
use gridweave_logs::qos;
use gridweave_logs::tf::is_static;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrames, RosMessage, TFMessage, TransformStamped, encode};
use gridweave_runtime::stage::{Context, Output, ParameterError, Parameters, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The depth of publishers that are not latched, messages.
const DEPTH: usize = 10;

/// The parameters of `ros_sink`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SinkParameters {
    /// The middlewares of ROS 2 on which everything is published: `auto` for both, `dds` for the default of ROS 2 alone
    /// (Fast DDS, Cyclone DDS), `zenoh` for `rmw_zenoh_cpp` alone.
    pub middleware: Middlewares,
    /// Where programs on DDS are looked for: `subnet` for the networks of this machine, `localhost` for this machine
    /// alone. If it is not given, the environment variables ROS_LOCALHOST_ONLY and ROS_AUTOMATIC_DISCOVERY_RANGE say
    /// it, as for ROS 2 programs.
    pub discovery_range: Option<DiscoveryRange>,
    /// Machines on which programs on DDS are looked for one by one, by name or address, where multicast does not reach
    /// them. If none are given, those that the environment variable ROS_STATIC_PEERS names.
    pub static_peers: Vec<String>,
    /// The ROS domain. The default is the environment variable ROS_DOMAIN_ID, or 0.
    pub domain: Option<u32>,
    /// The Zenoh routers and programs to connect to, as `tcp/HOST:PORT`. The connection is retried until it succeeds.
    pub connect: Vec<String>,
    /// The addresses where other programs may connect, as `tcp/HOST:PORT`; port 0 is any free port.
    pub listen: Vec<String>,
    /// A configuration file of Zenoh (JSON5) that replaces `connect` and `listen`, for example for TLS. The default is
    /// the environment variable ZENOH_SESSION_CONFIG_URI, as for ROS 2 programs.
    pub zenoh_config: Option<PathBuf>,
    /// The name of the ROS 2 node; the default is `gridweave_` and the name of the stage.
    pub node: Option<String>,
    /// Whether other runs of Gridweave take what is published for that of robots. If not, they leave it out, as this run
    /// does: no run is to merge its own map.
    pub as_robot: bool,
    /// Topics with other names than in a log, as `OLD=NEW`: `["/map=/fleet/map"]`. `{robot}` matches one part of both.
    pub rename: Vec<String>,
    /// Whether changed parts of a map are published on its topic with the suffix `_updates`
    /// (`map_msgs/msg/OccupancyGridUpdate`), if every node that subscribes to the map subscribes to these too. The
    /// whole map is sent if any node does not, for a late joiner, and once updates would have as many cells as the map.
    pub map_updates: bool,
}

impl Default for SinkParameters {
    fn default() -> Self {
        Self {
            middleware: Middlewares::default(),
            discovery_range: None,
            static_peers: Vec::new(),
            domain: None,
            connect: vec![ROUTER.to_owned()],
            listen: vec![LISTEN.to_owned()],
            zenoh_config: None,
            node: None,
            as_robot: false,
            rename: Vec::new(),
            map_updates: true,
        }
    }
}

impl SinkParameters {
    fn renames(&self) -> Result<Vec<TopicRename>, String> {
        self.rename.iter().map(|text| text.parse()).collect()
    }

    fn connection(&self) -> Connection {
        let Self { middleware, discovery_range, static_peers, domain, connect, listen, zenoh_config, node, .. } =
            self.clone();
        Connection { middleware, discovery_range, static_peers, domain, connect, listen, zenoh_config, node }
    }
}

impl Parameters for SinkParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = self.connection().check();
        if let Err(wrong) = self.renames() {
            errors.push(ParameterError::new("rename", wrong));
        }
        errors
    }
}

/// Whether a name is a valid full topic name in ROS 2.
fn is_topic(name: &str) -> bool {
    let is_part = |part: &str| {
        !part.is_empty()
            && !part.starts_with(|c: char| c.is_ascii_digit())
            && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    name.strip_prefix('/').is_some_and(|name| name.split('/').all(is_part))
}

/// The kind `ros_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "ros_sink",
        "Publishes its inputs in ROS 2, over DDS and over Zenoh as `rmw_zenoh_cpp` speaks it, on the topics that they have in a log. \
         States such as maps and static transforms are retained for late joiners (transient local). Of a map only the changed \
         part is sent if all subscribers support that. A frame is published again only after it has moved by more than its \
         uncertainty, given by the covariances in `gridweave_msgs/msg/RobotFrames`, if these are an input",
        RosSink::new,
    )
    .any_inputs("in", "what to publish: outputs of any stage but a source", RosSink::receive)
    .finish(RosSink::finish)
    .build()
}

/// Publishes its inputs in ROS 2.
struct RosSink {
    other_runs: OtherRuns,
    /// The published maps; `None` if maps are always sent whole.
    maps: Option<MapTopics>,
    node: Node,
    renames: Vec<TopicRename>,
    /// The type of each wire's messages.
    types: Vec<String>,
    /// The publishers by topic; none for a topic that cannot be published.
    publishers: BTreeMap<String, Option<Publisher>>,
    frames: PublishedFrames,
    trees: RobotTrees,
    /// The frames published in the robots' own trees, by robot.
    published_in_trees: BTreeMap<String, Vec<TransformStamped>>,
}

impl RosSink {
    fn new(parameters: SinkParameters, context: &Context) -> Result<Self, StageError> {
        if let Some(wire) = context.inputs.iter().find(|wire| wire.topic.is_empty()) {
            let text = format!("`{}` provides the robots' own messages, which would be sent back to them", wire.from);
            return Err(StageError::new(format!("make the stage `{}`", context.stage), text)
                .with_help("remove it from `inputs`"));
        }
        let doing = || format!("make the stage `{}`", context.stage);
        let renames = parameters.renames().map_err(|wrong| StageError::new(doing(), wrong))?;
        let name = NodeIdentity::of_stage(context, parameters.node.as_ref());
        let name = if parameters.as_robot { name.into_robot() } else { name };
        let node = Node::start(parameters.connection(), name)?;
        Ok(Self {
            other_runs: OtherRuns::watch(&node)?,
            maps: parameters.map_updates.then(|| MapTopics::watch(&node)).transpose()?,
            trees: RobotTrees::watch(&node)?,
            published_in_trees: BTreeMap::new(),
            node,
            renames,
            types: context.inputs.iter().map(|wire| wire.ros_type.clone()).collect(),
            publishers: BTreeMap::new(),
            frames: PublishedFrames::default(),
        })
    }

    fn receive(&mut self, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        self.node.take_problems().into_iter().for_each(|problem| output.warn_logged(problem));
        self.check_other_runs(output);
        let ros_type = self.types.get(message.wire()).cloned().unwrap_or_default();
        let topic = message.header().topic.as_str().to_owned();
        self.publish_in_robot_trees(output)?;
        if ros_type == RobotFrames::NAME
            && let Ok(frames) = message.decode::<RobotFrames>()
        {
            self.frames.set_covariances(&frames);
        }
        if ros_type == TFMessage::NAME && is_static(&topic) {
            return match message.decode::<TFMessage>() {
                Ok(transforms) => self.publish_frames(&topic, &transforms, output),
                Err(error) => {
                    output.warn(format!("transforms that cannot be decoded were skipped: {error}"));
                    Ok(())
                }
            };
        }
        if ros_type == OccupancyGrid::NAME && self.maps.is_some() && is_topic(&self.name(&topic)) {
            return self.publish_map(&topic, message, output);
        }
        self.publish(&topic, &ros_type, message.bytes(), output)
    }

    fn finish(&mut self, _: &Output<()>) -> Result<(), StageError> {
        self.maps.as_ref().map_or(Ok(()), MapTopics::send_updated)
    }

    /// Warns of other runs that publish the same.
    fn check_other_runs(&mut self, output: &Output<()>) {
        let (publishers, maps) = (&self.publishers, &self.maps);
        let is_published =
            |topic: &str| publishers.contains_key(topic) || maps.as_ref().is_some_and(|maps| maps.has(topic));
        self.other_runs.warnings(is_published).into_iter().for_each(|text| output.warn(text));
    }

    /// Publishes a map, or an update of its changed part.
    fn publish_map(&mut self, topic: &str, message: &Message, output: &Output<()>) -> Result<(), StageError> {
        let (name, Some(maps)) = (self.name(topic), &self.maps) else { return Ok(()) };
        let sent = match message.decode::<OccupancyGrid<'_>>() {
            Ok(map) => maps.send(&mut self.node, &name, &map, message.bytes())?,
            Err(_) => None,
        };
        match sent {
            Some(Sent::Whole) => output.count("messages published", 1),
            Some(Sent::Update) => {
                output.count("messages published", 1);
                output.count("map updates published", 1);
            }
            Some(Sent::Nothing) => output.count("maps without a change, not published", 1),
            None => {
                output.warn(format!("maps on `{name}` were skipped: their numbers of cells do not match their sizes"))
            }
        }
        Ok(())
    }

    /// The published name of a topic.
    fn name(&self, topic: &str) -> String {
        self.renames.iter().find_map(|rename| rename.apply(topic)).unwrap_or_else(|| topic.to_owned())
    }

    /// Publishes the static transforms of all frames in one message, because a publisher retains its last message only.
    /// Frames that moved by no more than their uncertainty are unchanged.
    fn publish_frames(&mut self, topic: &str, message: &TFMessage, output: &Output<()>) -> Result<(), StageError> {
        let mut is_changed = false;
        for transform in &message.transforms {
            let change = self.frames.update(transform);
            is_changed |= matches!(change, Change::First | Change::Moved { .. });
            report_change(transform, &change, output);
        }
        if !is_changed {
            return Ok(());
        }
        let transforms = self.frames.transforms().cloned().collect();
        self.publish_transforms(topic, transforms, output)?;
        self.publish_in_robot_trees(output)
    }

    /// Publishes the frames of robots with their own tf trees there too, with their names in these trees.
    fn publish_in_robot_trees(&mut self, output: &Output<()>) -> Result<(), StageError> {
        for (robot, topic) in self.trees.topics() {
            let transforms: Vec<_> =
                self.frames.transforms().filter_map(|transform| in_robot_tree(&robot, transform)).collect();
            if !transforms.is_empty() && self.published_in_trees.get(&robot) != Some(&transforms) {
                self.published_in_trees.insert(robot, transforms.clone());
                self.publish_transforms(&topic, transforms, output)?;
            }
        }
        Ok(())
    }

    fn publish_transforms(
        &mut self,
        topic: &str,
        transforms: Vec<TransformStamped>,
        output: &Output<()>,
    ) -> Result<(), StageError> {
        let bytes = encode(&TFMessage { transforms })
            .map_err(|error| StageError::new("publish the frames of the robots", error))?;
        self.publish(topic, TFMessage::NAME, &bytes, output)
    }

    fn publish(&mut self, topic: &str, ros_type: &str, bytes: &[u8], output: &Output<()>) -> Result<(), StageError> {
        let name = self.name(topic);
        let publisher = match self.publishers.get_mut(&name) {
            Some(publisher) => publisher,
            None => {
                let is_latched = qos::is_latched_result(topic, ros_type);
                let qos = if is_latched { Qos::latched(1) } else { Qos::reliable(DEPTH) };
                let topic = Topic::known(&name, ros_type).filter(|topic| is_topic(&topic.name));
                let publisher = topic.map(|topic| self.node.publish(topic, qos)).transpose()?;
                self.publishers.entry(name.clone()).or_insert(publisher)
            }
        };
        match publisher {
            Some(publisher) => {
                output.count("messages published", 1);
                publisher.send(bytes)
            }
            None => {
                output
                    .warn(format!("`{name}` was not published: ROS 2 has no topic of this name, or type `{ros_type}`"));
                Ok(())
            }
        }
    }
}

/// Counts and logs the change of a frame.
fn report_change(transform: &TransformStamped, change: &Change, output: &Output<()>) {
    let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
    match change {
        Change::First => {
            output.count("frames published", 1);
            tracing::info!("the frame `{child}` is published in `{parent}`");
        }
        Change::Moved { distance, angle } => {
            output.count("frames moved", 1);
            let degrees = angle.to_degrees();
            tracing::warn!("`{child}` has moved in `{parent}` by {distance:.3} m and {degrees:.2} degrees");
        }
        Change::WithinUncertainty => output.count("changes of frames within their uncertainty, not published", 1),
        Change::Unchanged => {}
        Change::OtherParent { before } => {
            output
                .warn(format!("`{child}` stays in `{before}`: a published frame cannot get the new parent `{parent}`"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn valid_topic_names_are_those_of_ros() {
        for name in ["/map", "/robot1/markers/walls", "/tf_static", "/_a/b2"] {
            assert!(is_topic(name), "{name}");
        }
        for name in ["", "/", "map", "/a//b", "/a/", "/2a", "/a b", "/a-b", "/a/*"] {
            assert!(!is_topic(name), "{name}");
        }
    }
}

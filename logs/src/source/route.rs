//! What a channel carries, by its topic and its type.

use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    OccupancyGrid, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange, TopologicalMap,
};
use gridweave_runtime::stage::{RobotTopics, match_robot};
use std::collections::BTreeSet;

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Occupancy grids of a robot.
    Map,
    /// Poses of a robot.
    Pose(PoseSource),
    /// Tag readings of a robot.
    Tags,
    /// Topological maps of a robot.
    Topology,
    /// Transforms from which poses of robots are made.
    Tf,
    /// Anything else.
    Other,
}

/// A type that holds a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PoseSource {
    /// `geometry_msgs/msg/PoseStamped`.
    Pose,
    /// `nav_msgs/msg/Odometry`.
    Odometry,
    /// `geometry_msgs/msg/PoseWithCovarianceStamped`.
    PoseWithCovariance,
}

/// What was found out about a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Classified<'a> {
    /// What it carries.
    pub(crate) role: Role,
    /// The robot that it is about; empty if none in particular.
    pub(crate) robot: &'a str,
    /// Why it is not what its topic lets one expect.
    pub(crate) mismatch: Option<String>,
}

/// Where AMCL and other localizers say the robot's pose in its map.
const LOCALIZER_POSE: &str = "/{robot}/amcl_pose";

/// Tells what the channels of logs carry.
#[derive(Clone, Debug)]
pub(crate) struct RobotChannels {
    topics: RobotTopics,
    /// The robots whose poses are on the topic that was named for them.
    posed: BTreeSet<String>,
}

impl RobotChannels {
    /// For logs with these channels.
    pub(crate) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel>) -> Self {
        let mut roles = Self { topics, posed: BTreeSet::new() };
        for channel in channels {
            if let Some(robot) = match_robot(&roles.topics.pose, &channel.topic)
                && matches!(roles.classify(channel).role, Role::Pose(_))
            {
                roles.posed.insert(robot.to_owned());
            }
        }
        roles
    }

    /// Tells what `channel` carries.
    pub(crate) fn classify<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let topic = channel.topic.as_str();
        let type_name = full_type_name(&channel.schema_name);
        let is_cdr = channel.message_encoding == "cdr";
        if self.topics.tf.is_some()
            && let Some(robot) = tf_topic(channel)
        {
            return Classified { role: Role::Tf, robot, mismatch: None };
        }
        // Poses come from tf alone if the pipeline says so.
        let has_topic = self.topics.tf.is_none();
        let expectations = [
            ("map", Some(&self.topics.map), OccupancyGrid::NAME, role_of_map as fn(&str) -> Option<Role>),
            ("pose", has_topic.then_some(&self.topics.pose), PoseStamped::NAME, role_of_pose),
            ("tags", Some(&self.topics.tags), TagRange::NAME, role_of_tags),
            ("topology", Some(&self.topics.topology), TopologicalMap::NAME, role_of_topology),
        ];
        let mut other = Classified { role: Role::Other, robot: "", mismatch: None };
        for (field, pattern, expected, role_of) in expectations {
            let Some(robot) = pattern.and_then(|pattern| match_robot(pattern, topic)) else { continue };
            match role_of(&type_name).filter(|_| is_cdr) {
                Some(role) => return Classified { role, robot, mismatch: None },
                None if is_cdr => {
                    other.robot = robot;
                    let found = if type_name.is_empty() { "messages without a schema" } else { &type_name };
                    other.mismatch = Some(format!(
                        "`{topic}` fits `robots.{field}` but carries {found} where {expected} is expected"
                    ));
                }
                None => {
                    other.robot = robot;
                    let encoding = &channel.message_encoding;
                    other.mismatch =
                        Some(format!("`{topic}` fits `robots.{field}` but is encoded as `{encoding}`, not as `cdr`"));
                }
            }
        }
        if has_topic
            && is_cdr
            && type_name == PoseWithCovarianceStamped::NAME
            && let Some(robot) = match_robot(LOCALIZER_POSE, topic).filter(|robot| !self.posed.contains(*robot))
        {
            return Classified { role: Role::Pose(PoseSource::PoseWithCovariance), robot, mismatch: None };
        }
        other
    }
}

fn role_of_map(type_name: &str) -> Option<Role> {
    (type_name == OccupancyGrid::NAME).then_some(Role::Map)
}

fn role_of_pose(type_name: &str) -> Option<Role> {
    match type_name {
        PoseStamped::NAME => Some(Role::Pose(PoseSource::Pose)),
        Odometry::NAME => Some(Role::Pose(PoseSource::Odometry)),
        PoseWithCovarianceStamped::NAME => Some(Role::Pose(PoseSource::PoseWithCovariance)),
        _ => None,
    }
}

fn role_of_tags(type_name: &str) -> Option<Role> {
    (type_name == TagRange::NAME).then_some(Role::Tags)
}

fn role_of_topology(type_name: &str) -> Option<Role> {
    (type_name == TopologicalMap::NAME).then_some(Role::Topology)
}

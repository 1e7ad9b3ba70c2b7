//! What a channel carries, by its topic and its type.

use super::scans::is_scan;
use super::tag_reader::{TagReader, has_poses_in_tf, known_fields};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    OccupancyGrid, OccupancyGridUpdate, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange,
    TopologicalMap,
};
use gridweave_runtime::stage::{RobotTopics, TagFields, match_robot};
use std::collections::BTreeSet;

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Occupancy grids of a robot.
    Map,
    /// Parts of a robot's map that have changed.
    MapUpdate,
    /// Poses of a robot.
    Pose(PoseSource),
    /// Odometry of a robot without a topic for poses, which gives them if it is in the frame of the map. Scans can be matched
    /// along any.
    Odometry,
    /// Tag readings of a robot.
    Tags,
    /// Tag readings of a robot in messages of another type.
    TagMessage,
    /// Topological maps of a robot.
    Topology,
    /// Scans of a robot that has no maps.
    Scan,
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
/// Where odometry is.
const ODOMETRY: &str = "/{robot}/odom";

/// Tells what the channels of logs carry.
#[derive(Clone, Debug)]
pub(crate) struct RobotChannels {
    topics: RobotTopics,
    /// Where updates of maps are: beside the maps, as ROS programs have it.
    map_updates: String,
    /// The robots whose maps are updated in parts.
    updated: BTreeSet<String>,
    /// The robots whose poses are on the topic that was named for them.
    posed: BTreeSet<String>,
    /// The robots with maps or tag readings and without a topic for poses.
    unposed: BTreeSet<String>,
    /// The robots of which there are maps, poses or tag readings.
    known: BTreeSet<String>,
    /// The known robots whose cameras see tags of which tf says where they are.
    tags_in_tf: BTreeSet<String>,
    /// Whether any message says where, or in which direction, tags are in the frame of a camera or another sensor.
    has_cameras: bool,
    /// The robots with scans and without maps.
    scanned: BTreeSet<String>,
    /// The robots with a topic for odometry.
    with_odometry: BTreeSet<String>,
}

impl RobotChannels {
    /// For logs with these channels.
    pub(crate) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel>) -> Self {
        let mut roles = Self {
            map_updates: format!("{}_updates", topics.map),
            topics,
            updated: BTreeSet::new(),
            posed: BTreeSet::new(),
            unposed: BTreeSet::new(),
            known: BTreeSet::new(),
            tags_in_tf: BTreeSet::new(),
            has_cameras: false,
            scanned: BTreeSet::new(),
            with_odometry: BTreeSet::new(),
        };
        let (mut asking, mut with_poses) = (BTreeSet::new(), BTreeSet::new());
        let channels: Vec<&Channel> = channels.collect();
        let has_map = |robot: &str| {
            let roles = &roles;
            channels
                .iter()
                .any(|channel| roles.classify(channel) == Classified { role: Role::Map, robot, mismatch: None })
        };
        let scanned = channels.iter().filter_map(|channel| roles.scanning_robot(channel));
        roles.scanned = scanned.filter(|robot| !has_map(robot)).map(str::to_owned).collect();
        for channel in &channels {
            let Classified { role, robot, .. } = roles.classify(channel);
            match role {
                Role::MapUpdate => roles.updated.insert(robot.to_owned()),
                Role::Map | Role::Tags | Role::TagMessage | Role::Scan => asking.insert(robot.to_owned()),
                Role::Pose(_) => with_poses.insert(robot.to_owned()),
                _ => false,
            };
            if let Some(robot) = match_robot(&roles.topics.pose, &channel.topic)
                && matches!(role, Role::Pose(_))
            {
                roles.posed.insert(robot.to_owned());
            }
        }
        roles.known = &asking | &with_poses;
        if roles.topics.tf.is_none() {
            roles.unposed = &asking - &with_poses;
        }
        for channel in channels {
            let is_mounted = |fields: &TagFields| fields.pose_field.is_some() || fields.bearing_field.is_some();
            roles.has_cameras |= roles.tag_fields(channel).is_some_and(|(_, fields)| is_mounted(&fields));
            if let Classified { role: Role::Odometry, robot, .. } = roles.classify(channel) {
                let robot = robot.to_owned();
                roles.with_odometry.insert(robot);
            }
            if has_poses_in_tf(&full_type_name(&channel.schema_name))
                && let Some(robot) = roles.known_robot(&channel.topic)
            {
                let robot = robot.to_owned();
                roles.tags_in_tf.insert(robot);
            }
        }
        roles
    }

    /// The known robot in whose namespace a topic is.
    fn known_robot<'a>(&self, topic: &'a str) -> Option<&'a str> {
        let (namespace, _) = self.topics.map.split_once("{robot}")?;
        let (robot, _) = topic.strip_prefix(namespace)?.split_once('/')?;
        self.known.contains(robot).then_some(robot)
    }

    /// The robot that reads tags on a channel whose type is not made for that, and where the readings are in its messages.
    fn tag_fields<'a>(&self, channel: &'a Channel) -> Option<(&'a str, TagFields)> {
        let type_name = full_type_name(&channel.schema_name);
        if channel.message_encoding != "cdr" || type_name == TagRange::NAME {
            return None;
        }
        let known = known_fields(&type_name);
        match match_robot(&self.topics.tags, &channel.topic) {
            Some(robot) => Some((robot, self.topics.tag_fields.clone().or(known)?)),
            None => {
                let fields = known.filter(|fields| fields.pose_field.is_some())?;
                Some((self.known_robot(&channel.topic)?, fields))
            }
        }
    }

    /// What reads the tags in the messages of a channel of [`Role::TagMessage`].
    pub(crate) fn tag_reader(&self, channel: &Channel) -> Option<TagReader> {
        let (_, fields) = self.tag_fields(channel)?;
        TagReader::new(channel, &fields).ok()
    }

    /// The robot whose scans a channel holds, or would hold if the robot had no map.
    pub(crate) fn scanning_robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        let holds_scans = channel.message_encoding == "cdr" && is_scan(&full_type_name(&channel.schema_name));
        match_robot(&self.topics.scan, &channel.topic).filter(|_| holds_scans)
    }

    /// The robots with scans and without maps, by name.
    pub(crate) fn scanned(&self) -> impl Iterator<Item = &str> {
        self.scanned.iter().map(String::as_str)
    }

    /// Whether a robot without a topic for poses has one for odometry.
    pub(crate) fn has_odometry(&self, robot: &str) -> bool {
        self.with_odometry.contains(robot)
    }

    /// The robots whose tags are frames in tf.
    pub(crate) fn tags_in_tf(&self) -> &BTreeSet<String> {
        &self.tags_in_tf
    }

    /// Whether frames of cameras matter.
    pub(crate) fn sees_tags(&self) -> bool {
        self.has_cameras || !self.tags_in_tf.is_empty()
    }

    /// Whether parts of a robot's map come after the map.
    pub(crate) fn updates_map(&self, robot: &str) -> bool {
        self.updated.contains(robot)
    }

    /// The robots with maps or tag readings whose poses are on no topic for them, by name.
    pub(crate) fn unposed(&self) -> impl Iterator<Item = &str> {
        self.unposed.iter().map(String::as_str)
    }

    /// Tells what `channel` carries.
    pub(crate) fn classify<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let topic = channel.topic.as_str();
        let type_name = full_type_name(&channel.schema_name);
        let is_cdr = channel.message_encoding == "cdr";
        if (self.topics.tf.is_some() || !self.unposed.is_empty() || self.sees_tags() || !self.scanned.is_empty())
            && let Some(robot) = tf_topic(channel)
        {
            return Classified { role: Role::Tf, robot, mismatch: None };
        }
        if let Some(robot) = self.scanning_robot(channel).filter(|robot| self.scanned.contains(*robot)) {
            return Classified { role: Role::Scan, robot, mismatch: None };
        }
        if let Some((robot, fields)) = self.tag_fields(channel) {
            return match TagReader::new(channel, &fields) {
                Ok(_) => Classified { role: Role::TagMessage, robot, mismatch: None },
                Err(why) => {
                    let mismatch = Some(format!("no tags are read on `{topic}`: {why}"));
                    Classified { role: Role::Other, robot, mismatch }
                }
            };
        }
        // Poses come from tf alone if the pipeline says so.
        let has_topic = self.topics.tf.is_none();
        let expectations = [
            ("map", Some(&self.topics.map), OccupancyGrid::NAME, role_of_map as fn(&str) -> Option<Role>),
            ("map", Some(&self.map_updates), OccupancyGridUpdate::NAME, role_of_map_update),
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
        if is_cdr
            && type_name == Odometry::NAME
            && let Some(robot) = match_robot(ODOMETRY, topic).filter(|robot| self.unposed.contains(*robot))
        {
            return Classified { role: Role::Odometry, robot, mismatch: None };
        }
        other
    }
}

fn role_of_map(type_name: &str) -> Option<Role> {
    (type_name == OccupancyGrid::NAME).then_some(Role::Map)
}

fn role_of_map_update(type_name: &str) -> Option<Role> {
    (type_name == OccupancyGridUpdate::NAME).then_some(Role::MapUpdate)
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

//! The role of a channel by its topic and its message type alone.

use super::driver_topics::DriverTopics;
use super::part_names::is_sensor;
use super::role::{Classified, PoseSource, Role};
use super::scan_topics::ScanTopics;
use super::tag_reader::{TagReader, known_fields};
use crate::robot_name::fits;
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    OccupancyGrid, OccupancyGridUpdate, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange,
    TopologicalMap,
};
use gridweave_runtime::stage::{RobotTopics, TagFields, match_robot};
use std::collections::BTreeSet;

/// Topic of the robot's pose in its map, as published by AMCL and other localizers.
const LOCALIZER_POSE: &str = "/{robot}/amcl_pose";
/// Topics of odometry under a robot's name, as the drivers of common bases and filters publish it.
const ODOMETRY: [&str; 12] = [
    "odom",
    "odometry/filtered",
    "platform/odom/filtered",
    "odometry",
    "wheel_odom",
    "wheel/odometry",
    "platform/odom",
    "base_controller/odom",
    "diff_drive_controller/odom",
    "mobile_base_controller/odom",
    "husky_velocity_controller/odom",
    "jackal_velocity_controller/odom",
];

/// Whether a channel has odometry on a usual topic without a robot's name, such as `/odom`.
pub(crate) fn is_nameless_odometry(channel: &Channel) -> bool {
    full_type_name(&channel.schema_name) == Odometry::NAME
        && channel.topic.strip_prefix('/').is_some_and(|name| ODOMETRY.contains(&name))
}

/// The topics of robots: those that the pipeline names, and those that drivers and localizers use by default.
#[derive(Clone, Debug)]
pub(super) struct ChannelPatterns {
    topics: RobotTopics,
    /// Topic pattern of map updates: the map topic and `_updates`, as ROS programs name it.
    map_updates: String,
    scan_topics: ScanTopics,
    odometry_topics: DriverTopics,
}

impl ChannelPatterns {
    /// Chooses the topics from the channels of logs.
    pub(super) fn new(topics: RobotTopics, channels: &[&Channel]) -> Self {
        let scan_topics = ScanTopics::new(&topics.scan, channels);
        let odometry = channels.iter().filter(|channel| full_type_name(&channel.schema_name) == Odometry::NAME);
        let odometry = odometry.map(|channel| channel.topic.as_str());
        let mut odometry_topics = DriverTopics::choose(&ODOMETRY, odometry.clone());
        let scanned: BTreeSet<&str> = channels.iter().filter_map(|channel| scan_topics.robot(channel)).collect();
        // The odometry of a camera is in the frame of the camera.
        odometry_topics.add_only_ones(&scanned, odometry.filter(|topic| !topic.split('/').skip(2).any(is_sensor)));
        Self { scan_topics, odometry_topics, map_updates: format!("{}_updates", topics.map), topics }
    }

    /// Whether the pipeline names frames of robots in tf. Then poses come from tf only.
    pub(super) fn has_tf_frames(&self) -> bool {
        self.topics.tf.is_some()
    }

    /// The robot whose scans a channel holds.
    pub(super) fn scan<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        self.scan_topics.robot(channel).filter(|robot| fits(robot))
    }

    /// What is said of the other lidars of a robot whose scans a channel holds.
    pub(super) fn lidar_note(&self, channel: &Channel) -> Option<String> {
        self.scan_topics.note(self.scan(channel)?, &channel.topic)
    }

    /// The robot in whose namespace a topic is, by the pattern of map topics.
    pub(super) fn namespace<'a>(&self, topic: &'a str) -> Option<&'a str> {
        let (namespace, _) = self.topics.map.split_once("{robot}")?;
        let (robot, _) = topic.strip_prefix(namespace)?.split_once('/')?;
        Some(robot)
    }

    /// Whether a topic is the one that the pipeline names for poses.
    pub(super) fn is_pose_topic(&self, topic: &str) -> bool {
        match_robot(&self.topics.pose, topic).is_some()
    }

    /// The robot whose tag readings a channel of a general type holds, and the fields that contain them. Detections in
    /// the namespace of a robot are its own if `is_known` holds for it.
    pub(super) fn tag_fields<'a>(
        &self,
        channel: &'a Channel,
        is_known: impl Fn(&str) -> bool,
    ) -> Option<(&'a str, TagFields)> {
        let type_name = full_type_name(&channel.schema_name);
        if channel.message_encoding != "cdr" || type_name == TagRange::NAME {
            return None;
        }
        let known = known_fields(&type_name);
        match match_robot(&self.topics.tags, &channel.topic) {
            Some(robot) => Some((robot, self.topics.tag_fields.clone().or(known)?)),
            None => {
                let fields = known.filter(|fields| fields.pose_field.is_some())?;
                Some((self.namespace(&channel.topic).filter(|robot| is_known(robot))?, fields))
            }
        }
    }

    /// The role of a channel on a topic that the pipeline names. Without a role, the reason if the topic suggests one.
    pub(super) fn named<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let topic = channel.topic.as_str();
        let type_name = full_type_name(&channel.schema_name);
        let is_cdr = channel.message_encoding == "cdr";
        let pose = (!self.has_tf_frames()).then_some(&self.topics.pose);
        let expectations = [
            ("map", Some(&self.topics.map), OccupancyGrid::NAME, role_of_map as fn(&str) -> Option<Role>),
            ("map", Some(&self.map_updates), OccupancyGridUpdate::NAME, role_of_map_update),
            ("pose", pose, PoseStamped::NAME, role_of_pose),
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
                    let cure = match encoding == "ros1" {
                        true => ", and its definition cannot be read; give the ROS 1 bag (.bag) it was made from",
                        false => "",
                    };
                    other.mismatch = Some(format!(
                        "`{topic}` fits `robots.{field}` but is encoded as `{encoding}`, not as `cdr`{cure}"
                    ));
                }
            }
        }
        other
    }

    /// The robot whose localizer publishes its poses on a channel.
    pub(super) fn localizer<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        let is_cdr = channel.message_encoding == "cdr";
        if self.has_tf_frames() || !is_cdr || full_type_name(&channel.schema_name) != PoseWithCovarianceStamped::NAME {
            return None;
        }
        match_robot(LOCALIZER_POSE, &channel.topic)
    }

    /// The robot whose odometry a channel holds.
    pub(super) fn odometry<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        if channel.message_encoding != "cdr" || full_type_name(&channel.schema_name) != Odometry::NAME {
            return None;
        }
        self.odometry_topics.robot(&channel.topic)
    }
}

/// The role of a channel with tag readings of a general type, in these fields.
pub(super) fn tag_message<'a>(channel: &'a Channel, robot: &'a str, fields: &TagFields) -> Classified<'a> {
    match TagReader::new(channel, fields) {
        Ok(_) => Classified { role: Role::TagMessage, robot, mismatch: None },
        Err(why) => {
            let mismatch = Some(format!("cannot read tags on `{}`: {why}", channel.topic));
            Classified { role: Role::Other, robot, mismatch }
        }
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

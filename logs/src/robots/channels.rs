//! The role of each channel in a log, decided by its topic and its message type.

use super::driver_topics::DriverTopics;
use super::scan_topics::ScanTopics;
use super::tag_reader::{TagReader, has_poses_in_tf, known_fields};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::{Channel, LONGEST_ROBOT_NAME, LONGEST_TOPIC, shortened};
use gridweave_runtime::ros::{
    OccupancyGrid, OccupancyGridUpdate, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange,
    TopologicalMap,
};
use gridweave_runtime::stage::{RobotTopics, TagFields, match_robot};
use std::collections::BTreeSet;

/// The role of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Occupancy grids of a robot.
    Map,
    /// Updates of parts of a robot's map.
    MapUpdate,
    /// Poses of a robot.
    Pose(PoseSource),
    /// Odometry of a robot without a pose topic. It gives the robot's poses if its frame is the map frame; scans can be
    /// matched along it in any frame.
    Odometry,
    /// Tag readings of a robot.
    Tags,
    /// Tag readings of a robot in messages of another type, such as those of detectors.
    TagMessage,
    /// Topological maps of a robot.
    Topology,
    /// Scans of a robot without maps.
    Scan,
    /// Transforms, from which poses of robots are derived.
    Tf,
    /// Anything else.
    Other,
}

/// A message type that contains a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PoseSource {
    /// `geometry_msgs/msg/PoseStamped`.
    Pose,
    /// `nav_msgs/msg/Odometry`.
    Odometry,
    /// `geometry_msgs/msg/PoseWithCovarianceStamped`.
    PoseWithCovariance,
}

/// The role of a channel, and the robot that it belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Classified<'a> {
    /// The role.
    pub(crate) role: Role,
    /// The robot; empty if the channel belongs to none.
    pub(crate) robot: &'a str,
    /// Why the role is not the one that the topic suggests.
    pub(crate) mismatch: Option<String>,
}

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

/// Classifies the channels of logs.
#[derive(Clone, Debug)]
pub(crate) struct RobotChannels {
    topics: RobotTopics,
    /// Topic pattern of map updates: the map topic and `_updates`, as ROS programs name it.
    map_updates: String,
    /// Robots with map updates.
    updated: BTreeSet<String>,
    /// Robots with messages on the configured pose topic.
    posed: BTreeSet<String>,
    /// Robots with maps or tag readings and without a pose topic.
    unposed: BTreeSet<String>,
    /// Robots with maps and a pose topic.
    mapped_and_posed: BTreeSet<String>,
    /// Robots with maps, poses or tag readings.
    known: BTreeSet<String>,
    /// Known robots whose detectors publish tag poses in tf only.
    tags_in_tf: BTreeSet<String>,
    /// Whether any channel holds positions or bearings of tags in a sensor frame.
    has_cameras: bool,
    /// Robots with maps.
    mapped: BTreeSet<String>,
    /// Robots with scans and without maps.
    scanned: BTreeSet<String>,
    scan_topics: ScanTopics,
    odometry_topics: DriverTopics,
    /// Robots with an odometry topic.
    with_odometry: BTreeSet<String>,
}

impl RobotChannels {
    /// Creates a classifier for logs with these channels.
    pub(crate) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel>) -> Self {
        let channels: Vec<&Channel> = channels.collect();
        let scan_topics = ScanTopics::new(&topics.scan, &channels);
        let odometry = channels.iter().filter(|channel| full_type_name(&channel.schema_name) == Odometry::NAME);
        let odometry_topics = DriverTopics::choose(&ODOMETRY, odometry.map(|channel| channel.topic.as_str()));
        let mut roles = Self {
            map_updates: format!("{}_updates", topics.map),
            topics,
            updated: BTreeSet::new(),
            posed: BTreeSet::new(),
            unposed: BTreeSet::new(),
            mapped_and_posed: BTreeSet::new(),
            known: BTreeSet::new(),
            tags_in_tf: BTreeSet::new(),
            has_cameras: false,
            mapped: BTreeSet::new(),
            scanned: BTreeSet::new(),
            scan_topics,
            odometry_topics,
            with_odometry: BTreeSet::new(),
        };
        let (mut asking, mut with_poses) = (BTreeSet::new(), BTreeSet::new());
        let maps = channels.iter().map(|channel| roles.classify(channel)).filter(|channel| channel.role == Role::Map);
        let with_maps: BTreeSet<&str> = maps.map(|channel| channel.robot).collect();
        let scanned = channels.iter().filter_map(|channel| roles.scanning_robot(channel));
        roles.scanned = scanned.filter(|robot| !with_maps.contains(robot)).map(str::to_owned).collect();
        for channel in &channels {
            let Classified { role, robot, .. } = roles.classify(channel);
            if role == Role::Map {
                roles.mapped.insert(robot.to_owned());
            }
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
        roles.mapped_and_posed = &roles.mapped & &with_poses;
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

    /// The known robot whose namespace contains the topic.
    fn known_robot<'a>(&self, topic: &'a str) -> Option<&'a str> {
        let (namespace, _) = self.topics.map.split_once("{robot}")?;
        let (robot, _) = topic.strip_prefix(namespace)?.split_once('/')?;
        self.known.contains(robot).then_some(robot)
    }

    /// The robot whose tag readings a channel of a general type holds, and the fields that contain them.
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

    /// The reader of the tag readings on a channel of [`Role::TagMessage`].
    pub(crate) fn tag_reader(&self, channel: &Channel) -> Option<TagReader> {
        let (_, fields) = self.tag_fields(channel)?;
        TagReader::new(channel, &fields).ok()
    }

    /// The robot of a channel with scans, whether or not the robot has a map.
    pub(crate) fn scanning_robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        self.scan_topics.robot(channel).filter(|robot| fits(robot))
    }

    /// Robots with maps, sorted by name.
    pub(crate) fn mapped(&self) -> impl Iterator<Item = &str> + Clone {
        self.mapped.iter().map(String::as_str)
    }

    /// Robots with scans and without maps, sorted by name.
    pub(crate) fn scanned(&self) -> impl Iterator<Item = &str> {
        self.scanned.iter().map(String::as_str)
    }

    /// Whether a robot without a pose topic has an odometry topic.
    pub(crate) fn has_odometry(&self, robot: &str) -> bool {
        self.with_odometry.contains(robot)
    }

    /// Robots whose tags are frames in tf.
    pub(crate) fn tags_in_tf(&self) -> &BTreeSet<String> {
        &self.tags_in_tf
    }

    /// Whether sensor frames are needed to locate tags.
    pub(crate) fn sees_tags(&self) -> bool {
        self.has_cameras || !self.tags_in_tf.is_empty()
    }

    /// Whether a robot's map is updated in parts.
    pub(crate) fn updates_map(&self, robot: &str) -> bool {
        self.updated.contains(robot)
    }

    /// Robots with maps or tag readings and without a pose topic, sorted by name.
    pub(crate) fn unposed(&self) -> impl Iterator<Item = &str> {
        self.unposed.iter().map(String::as_str)
    }

    /// Robots with maps and a pose topic, sorted by name.
    pub(crate) fn mapped_and_posed(&self) -> impl Iterator<Item = &str> {
        self.mapped_and_posed.iter().map(String::as_str)
    }

    /// Whether anything is derived from tf.
    fn needs_tf(&self) -> bool {
        let with_frames = [&self.unposed, &self.mapped_and_posed, &self.scanned];
        self.topics.tf.is_some() || self.sees_tags() || with_frames.iter().any(|robots| !robots.is_empty())
    }

    /// Classifies a channel. One whose names do not fit in the header of a message is no robot's: the others go on
    /// without it.
    pub(crate) fn classify<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let classified = self.classify_by_type(channel);
        let name_fits = fits(classified.robot);
        if classified.role == Role::Other || (name_fits && channel.topic.len() <= LONGEST_TOPIC) {
            return classified;
        }
        let (topic, length) = (shortened(&channel.topic), classified.robot.len());
        let why = match length > LONGEST_ROBOT_NAME {
            true => format!("has {length} bytes, and at most {LONGEST_ROBOT_NAME} fit"),
            false => "contains a zero byte".to_owned(),
        };
        let topic = topic.escape_debug();
        let mismatch = format!("`{topic}` is not read as a robot's: the robot's name {why}; rename the topic");
        // Of a topic that is too long, it is said where its messages are dropped.
        Classified { role: Role::Other, robot: "", mismatch: (!name_fits).then_some(mismatch) }
    }

    fn classify_by_type<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let topic = channel.topic.as_str();
        let type_name = full_type_name(&channel.schema_name);
        let is_cdr = channel.message_encoding == "cdr";
        if self.needs_tf()
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
                    let mismatch = Some(format!("cannot read tags on `{topic}`: {why}"));
                    Classified { role: Role::Other, robot, mismatch }
                }
            };
        }
        // With `robots.tf` in the pipeline, poses come from tf only.
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
        if has_topic
            && is_cdr
            && type_name == PoseWithCovarianceStamped::NAME
            && let Some(robot) = match_robot(LOCALIZER_POSE, topic).filter(|robot| !self.posed.contains(*robot))
        {
            return Classified { role: Role::Pose(PoseSource::PoseWithCovariance), robot, mismatch: None };
        }
        if is_cdr
            && type_name == Odometry::NAME
            && let Some(robot) = self.odometry_topics.robot(topic).filter(|robot| self.unposed.contains(*robot))
        {
            return Classified { role: Role::Odometry, robot, mismatch: None };
        }
        other
    }
}

/// Whether the name of a robot fits in the header of a message, where a zero byte ends it.
pub(crate) fn fits(robot: &str) -> bool {
    robot.len() <= LONGEST_ROBOT_NAME && !robot.contains('\0')
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

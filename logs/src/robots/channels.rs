//! The role of each channel in a log, decided by its topic, its message type, and the other channels of its robot.

use super::channel_patterns::{ChannelPatterns, tag_message};
use super::role::{Classified, PoseSource, Role};
use super::tag_reader::{TagReader, has_poses_in_tf, known_fields};
use crate::robot_name::fits;
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::{Channel, LONGEST_ROBOT_NAME, LONGEST_TOPIC, shortened};
use gridweave_runtime::ros::{Odometry, PointCloud2, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange};
use gridweave_runtime::stage::{RobotTopics, TagFields};
use std::collections::BTreeMap;

/// Classifies the channels of logs.
#[derive(Clone, Debug)]
pub(crate) struct RobotChannels {
    patterns: ChannelPatterns,
    robots: BTreeMap<String, RobotData>,
    /// Whether any channel holds positions or bearings of tags in a sensor frame.
    has_cameras: bool,
    /// Whether anything is derived from tf.
    needs_tf: bool,
}

/// The data of a robot in the channels of logs, by their topics and types alone.
#[derive(Clone, Copy, Debug, Default)]
struct RobotData {
    has_maps: bool,
    has_map_updates: bool,
    has_scans: bool,
    /// Whether there are maps, scans or tag readings, which need poses.
    needs_poses: bool,
    /// Whether there are poses on any topic, that of a localizer for one.
    has_poses: bool,
    /// Whether there are poses on the topic that the pipeline names.
    has_named_poses: bool,
    has_odometry: bool,
    /// Whether detectors in the robot's namespace publish the poses of tags in tf only.
    has_tags_in_tf: bool,
    /// Whether the robot's namespace has messages of a body: of sensors, poses or commands.
    has_body: bool,
}

impl RobotData {
    /// Whether the robot has maps, scans, poses or tag readings.
    fn is_known(self) -> bool {
        self.needs_poses || self.has_poses
    }

    /// Whether a map is built from the scans.
    fn is_scanned(self) -> bool {
        self.has_scans && !self.has_maps
    }

    fn is_mapped_and_posed(self) -> bool {
        self.has_maps && self.has_poses
    }

    fn lacks_poses(self) -> bool {
        self.needs_poses && !self.has_poses
    }
}

impl RobotChannels {
    /// Creates a classifier for logs with these channels.
    pub(crate) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel>) -> Self {
        let channels: Vec<&Channel> = channels.collect();
        let patterns = ChannelPatterns::new(topics, &channels);
        let robots = data_of_robots(&patterns, &channels);
        let mut roles = Self { patterns, robots, has_cameras: false, needs_tf: false };
        let is_mounted = |fields: TagFields| fields.pose_field.is_some() || fields.bearing_field.is_some();
        let mut tag_fields = channels.iter().filter_map(|channel| roles.tag_fields(channel));
        roles.has_cameras = tag_fields.any(|(_, fields)| is_mounted(fields));
        let is_derived = |robot: &RobotData| robot.is_scanned() || robot.is_mapped_and_posed() || robot.lacks_poses();
        roles.needs_tf = roles.patterns.has_tf_frames() || roles.sees_tags() || roles.robots.values().any(is_derived);
        roles
    }

    fn data(&self, robot: &str) -> RobotData {
        self.robots.get(robot).copied().unwrap_or_default()
    }

    /// The names of the robots that meet a condition, sorted.
    fn robots(&self, is_meant: fn(RobotData) -> bool) -> impl Iterator<Item = &str> + Clone {
        self.robots.iter().filter(move |(_, data)| is_meant(**data)).map(|(robot, _)| robot.as_str())
    }

    /// The robot whose tag readings a channel of a general type holds, and the fields that contain them.
    fn tag_fields<'a>(&self, channel: &'a Channel) -> Option<(&'a str, TagFields)> {
        self.patterns.tag_fields(channel, |robot| self.data(robot).is_known())
    }

    /// The reader of the tag readings on a channel of [`Role::TagMessage`].
    pub(crate) fn tag_reader(&self, channel: &Channel) -> Option<TagReader> {
        let (_, fields) = self.tag_fields(channel)?;
        TagReader::new(channel, &fields).ok()
    }

    /// The robot of a channel with scans, whether or not the robot has a map.
    pub(crate) fn scanning_robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        self.patterns.scan(channel)
    }

    /// What is said of the other lidars of a robot of whose scans on a channel a map is built.
    pub(crate) fn lidar_note(&self, channel: &Channel) -> Option<String> {
        self.patterns.lidar_note(channel)
    }

    /// The robot in whose namespace a topic is, known or not.
    pub(crate) fn namespace<'a>(&self, topic: &'a str) -> Option<&'a str> {
        self.patterns.namespace(topic)
    }

    /// Robots with maps, sorted by name.
    pub(crate) fn mapped(&self) -> impl Iterator<Item = &str> + Clone {
        self.robots(|data| data.has_maps)
    }

    /// Whether a robot has maps.
    pub(crate) fn is_mapped(&self, robot: &str) -> bool {
        self.data(robot).has_maps
    }

    /// Robots with maps and anything else, sorted by name.
    pub(crate) fn mapped_with_more(&self) -> impl Iterator<Item = &str> {
        self.robots(|data| data.has_maps && data.has_body)
    }

    /// Whether a robot has anything but maps.
    pub(crate) fn has_more_than_maps(&self, robot: &str) -> bool {
        self.data(robot).has_body
    }

    /// The option `--robots` that names all robots with maps, or all but one of them.
    pub(crate) fn robots_option(&self, but: Option<&str>) -> String {
        let robots: Vec<&str> = self.robots(RobotData::is_known).filter(|robot| Some(*robot) != but).collect();
        format!("--robots {}", robots.join(","))
    }

    /// Robots with scans and without maps, sorted by name.
    pub(crate) fn scanned(&self) -> impl Iterator<Item = &str> {
        self.robots(RobotData::is_scanned)
    }

    /// Whether a robot without a pose topic has an odometry topic.
    pub(crate) fn has_odometry(&self, robot: &str) -> bool {
        self.is_unposed(robot) && self.data(robot).has_odometry
    }

    /// Known robots whose tags are frames in tf, sorted by name.
    pub(crate) fn tags_in_tf(&self) -> impl Iterator<Item = &str> {
        self.robots(|data| data.is_known() && data.has_tags_in_tf)
    }

    /// Whether sensor frames are needed to locate tags.
    pub(crate) fn sees_tags(&self) -> bool {
        self.has_cameras || self.tags_in_tf().next().is_some()
    }

    /// Whether a robot's map is updated in parts.
    pub(crate) fn updates_map(&self, robot: &str) -> bool {
        self.data(robot).has_map_updates
    }

    /// Robots with maps, scans or tag readings and without a pose topic, sorted by name. None if the pipeline names
    /// frames of robots in tf.
    pub(crate) fn unposed(&self) -> impl Iterator<Item = &str> {
        self.robots(RobotData::lacks_poses).filter(|_| !self.patterns.has_tf_frames())
    }

    fn is_unposed(&self, robot: &str) -> bool {
        !self.patterns.has_tf_frames() && self.data(robot).lacks_poses()
    }

    /// Robots with maps and a pose topic, sorted by name.
    pub(crate) fn mapped_and_posed(&self) -> impl Iterator<Item = &str> {
        self.robots(RobotData::is_mapped_and_posed)
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
        // A topic that is too long is reported where its messages are dropped.
        Classified { role: Role::Other, robot: "", mismatch: (!name_fits).then_some(mismatch) }
    }

    fn classify_by_type<'a>(&self, channel: &'a Channel) -> Classified<'a> {
        let of_robot = |role: Role, robot: &'a str| Classified { role, robot, mismatch: None };
        if self.needs_tf
            && let Some(robot) = tf_topic(channel)
        {
            return of_robot(Role::Tf, robot);
        }
        if let Some(robot) = self.patterns.scan(channel).filter(|robot| self.data(robot).is_scanned()) {
            return of_robot(Role::Scan, robot);
        }
        if let Some((robot, fields)) = self.tag_fields(channel) {
            return tag_message(channel, robot, &fields);
        }
        let named = self.patterns.named(channel);
        if named.role != Role::Other {
            return named;
        }
        if let Some(robot) = self.patterns.localizer(channel).filter(|robot| !self.data(robot).has_named_poses) {
            return of_robot(Role::Pose(PoseSource::PoseWithCovariance), robot);
        }
        if let Some(robot) = self.patterns.odometry(channel).filter(|robot| self.is_unposed(robot)) {
            return of_robot(Role::Odometry, robot);
        }
        named
    }
}

/// The data of each robot, by name.
fn data_of_robots(patterns: &ChannelPatterns, channels: &[&Channel]) -> BTreeMap<String, RobotData> {
    let mut robots: BTreeMap<String, RobotData> = BTreeMap::new();
    for channel in channels {
        let topic = channel.topic.as_str();
        let is_usable = |robot: &str| fits(robot) && topic.len() <= LONGEST_TOPIC;
        if let Some(robot) = patterns.scan(channel) {
            let data = robots.entry(robot.to_owned()).or_default();
            data.has_scans = true;
            data.needs_poses |= is_usable(robot);
        }
        if has_poses_in_tf(&full_type_name(&channel.schema_name))
            && let Some(robot) = patterns.namespace(topic)
        {
            robots.entry(robot.to_owned()).or_default().has_tags_in_tf = true;
        }
        if is_of_a_body(&full_type_name(&channel.schema_name))
            && let Some(robot) = patterns.namespace(topic)
        {
            robots.entry(robot.to_owned()).or_default().has_body = true;
        }
        let Some((role, robot)) = role_by_type(patterns, channel).filter(|(_, robot)| is_usable(robot)) else {
            continue;
        };
        let data = robots.entry(robot.to_owned()).or_default();
        data.has_maps |= role == Role::Map;
        data.has_map_updates |= role == Role::MapUpdate;
        data.needs_poses |= matches!(role, Role::Map | Role::Tags | Role::TagMessage);
        data.has_poses |= matches!(role, Role::Pose(_));
        data.has_named_poses |= matches!(role, Role::Pose(_)) && patterns.is_pose_topic(topic);
        data.has_odometry |= role == Role::Odometry;
    }
    robots
}

/// Whether messages of a type are those of a robot's body. Point clouds are not: they may be maps.
fn is_of_a_body(type_name: &str) -> bool {
    const TYPES: [&str; 6] = [
        Odometry::NAME,
        PoseStamped::NAME,
        PoseWithCovarianceStamped::NAME,
        TagRange::NAME,
        "geometry_msgs/msg/Twist",
        "geometry_msgs/msg/TwistStamped",
    ];
    let is_sensor = type_name.starts_with("sensor_msgs/") && type_name != PointCloud2::NAME;
    is_sensor || TYPES.contains(&type_name) || known_fields(type_name).is_some()
}

/// The role that a channel may have, whatever the other channels of its robot are, and the robot.
fn role_by_type<'a>(patterns: &ChannelPatterns, channel: &'a Channel) -> Option<(Role, &'a str)> {
    if let Some((robot, fields)) = patterns.tag_fields(channel, |_| false) {
        return Some((tag_message(channel, robot, &fields).role, robot));
    }
    let named = patterns.named(channel);
    if named.role != Role::Other {
        return Some((named.role, named.robot));
    }
    let localizer = patterns.localizer(channel).map(|robot| (Role::Pose(PoseSource::PoseWithCovariance), robot));
    localizer.or_else(|| Some((Role::Odometry, patterns.odometry(channel)?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{LaserScan, OccupancyGrid, TFMessage};

    #[test]
    fn roles_do_not_depend_on_the_order_of_the_channels() {
        const LOCALIZED: &str = PoseWithCovarianceStamped::NAME;
        let expected = [
            ("/mapped/map", OccupancyGrid::NAME, Role::Map),
            ("/mapped/scan", LaserScan::NAME, Role::Other),
            ("/mapped/amcl_pose", LOCALIZED, Role::Pose(PoseSource::PoseWithCovariance)),
            ("/mapped/odom", Odometry::NAME, Role::Other),
            ("/posed/map", OccupancyGrid::NAME, Role::Map),
            ("/posed/amcl_pose", LOCALIZED, Role::Other),
            ("/posed/pose", PoseStamped::NAME, Role::Pose(PoseSource::Pose)),
            ("/scanned/scan", LaserScan::NAME, Role::Scan),
            ("/scanned/odom", Odometry::NAME, Role::Odometry),
            ("/tf", TFMessage::NAME, Role::Tf),
        ];
        let channel = |(topic, type_name, _): &(&str, &str, Role)| Channel {
            topic: (*topic).to_owned(),
            schema_name: (*type_name).to_owned(),
            message_encoding: "cdr".to_owned(),
            ..Default::default()
        };
        let mut channels: Vec<Channel> = expected.iter().map(channel).collect();
        for _ in 0..channels.len() {
            channels.rotate_left(1);
            for order in [channels.clone(), channels.iter().rev().cloned().collect()] {
                let roles = RobotChannels::new(RobotTopics::default(), order.iter());
                for (topic, _, role) in &expected {
                    let channel = channels.iter().find(|channel| channel.topic == *topic).unwrap();
                    assert_eq!(roles.classify(channel).role, *role, "{topic}");
                }
                assert_eq!(roles.mapped().collect::<Vec<_>>(), ["mapped", "posed"]);
                assert_eq!(roles.mapped_and_posed().collect::<Vec<_>>(), ["mapped", "posed"]);
                assert_eq!(roles.scanned().collect::<Vec<_>>(), ["scanned"]);
                assert_eq!(roles.unposed().collect::<Vec<_>>(), ["scanned"]);
                assert!(roles.has_odometry("scanned") && !roles.has_odometry("mapped"));
            }
        }
    }
}

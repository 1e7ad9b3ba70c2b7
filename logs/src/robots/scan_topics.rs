//! The topics on which the lidars of robots publish.

use super::driver_topics::DriverTopics;
use super::part_names::is_sensor;
use super::scans::is_scan;
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{PointCloud2, RosMessage};
use gridweave_runtime::stage::match_robot;
use std::collections::{BTreeMap, BTreeSet};

/// Topics of scans under a robot's name, as robots with several lidars and drivers publish them.
const LIDAR_SCANS: [&str; 18] = [
    "scan_front",
    "front/scan",
    "front_scan",
    "front_laser/scan",
    "front_lidar/scan",
    "laser_front/scan",
    "lidar_front/scan",
    "base_scan",
    "laser_scan",
    "laser/scan",
    "lidar/scan",
    "scan_raw",
    "scan_filtered",
    "scan_rear",
    "rear/scan",
    "rear_scan",
    "rear_laser/scan",
    "rear_lidar/scan",
];
/// Topics of point clouds under a robot's name, as drivers of 3D lidars and simulators publish them. Clouds on others
/// may be those of cameras, or of SLAM in its map.
const LIDAR_CLOUDS: [&str; 12] = [
    "points",
    "velodyne_points",
    "ouster/points",
    "os_cloud_node/points",
    "lidar_points",
    "lidar/points",
    "rslidar_points",
    "livox/lidar",
    "velodyne/points",
    "scan/points",
    "points_raw",
    "cloud",
];

/// Whether a topic without a robot's name is one on which lidars publish.
pub(crate) fn is_lidar_topic(topic: &str) -> bool {
    topic.strip_prefix('/').is_some_and(|name| LIDAR_SCANS.contains(&name) || LIDAR_CLOUDS.contains(&name))
}

/// The topics with the scans of robots: the one that the pipeline names, of scans or point clouds; for a robot that has
/// none, the first of [`LIDAR_SCANS`], or else of [`LIDAR_CLOUDS`].
#[derive(Clone, Debug, Default)]
pub(super) struct ScanTopics {
    /// The topic that the pipeline names, with `{robot}`.
    pattern: String,
    /// Those that drivers use, of robots without the topic that the pipeline names.
    drivers: [DriverTopics; 2],
    /// By robot: the scans of its other lidars, which are not read.
    unread: BTreeMap<String, Vec<String>>,
}

impl ScanTopics {
    /// Chooses the topics from the channels of logs.
    pub(super) fn new(pattern: &str, channels: &[&Channel]) -> Self {
        let mut topics = Self { pattern: pattern.to_owned(), ..Self::default() };
        let (clouds, scans): (Vec<&Channel>, Vec<&Channel>) = channels
            .iter()
            .filter(|channel| is_scan(&full_type_name(&channel.schema_name)))
            .partition(|channel| full_type_name(&channel.schema_name) == PointCloud2::NAME);
        let kinds: [(&[&str], &[&Channel]); 2] = [(&LIDAR_SCANS, &scans), (&LIDAR_CLOUDS, &clouds)];
        for (place, (names, of_kind)) in kinds.into_iter().enumerate() {
            let known: BTreeSet<&str> = channels.iter().filter_map(|channel| topics.robot(channel)).collect();
            let mut chosen = DriverTopics::choose(names, of_kind.iter().map(|channel| channel.topic.as_str()));
            chosen.retain(|robot| !known.contains(robot) && !is_sensor(robot));
            topics.drivers[place] = chosen;
        }
        let mut unread: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for channel in scans.iter().filter(|channel| topics.robot(channel).is_none()) {
            let robot = channel.topic.split('/').nth(1).unwrap_or_default();
            unread.entry(robot.to_owned()).or_default().push(channel.topic.clone());
        }
        topics.unread = unread;
        topics
    }

    /// What is said of a robot whose scans are on `topic` and that has other lidars, with the option that reads another.
    pub(super) fn note(&self, robot: &str, topic: &str) -> Option<String> {
        let is_chosen = self.drivers[0].robot(topic) == Some(robot);
        let unread = self.unread.get(robot).filter(|_| is_chosen)?;
        Some(format!(
            "of the lidars of {robot}, the one on `{topic}` is read, and not those on {}: `--rename {}={}` reads another",
            list_in_words(unread),
            unread.first()?,
            self.pattern.replace("{robot}", robot)
        ))
    }

    /// The robot whose scans a channel holds.
    pub(super) fn robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        if channel.message_encoding != "cdr" || !is_scan(&full_type_name(&channel.schema_name)) {
            return None;
        }
        let by_driver = || self.drivers.iter().find_map(|topics| topics.robot(&channel.topic));
        match_robot(&self.pattern, &channel.topic).or_else(by_driver)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::LaserScan;

    fn channel(topic: &str, type_name: &str) -> Channel {
        Channel {
            topic: topic.to_owned(),
            schema_name: type_name.to_owned(),
            message_encoding: "cdr".to_owned(),
            ..Default::default()
        }
    }

    fn chosen(topics: &[(&str, &str)]) -> Vec<(String, String)> {
        let channels: Vec<Channel> = topics.iter().map(|(topic, type_name)| channel(topic, type_name)).collect();
        let of: Vec<&Channel> = channels.iter().collect();
        let topics = ScanTopics::new("/{robot}/scan", &of);
        let robot = |channel: &Channel| topics.robot(channel).map(|robot| (robot.to_owned(), channel.topic.clone()));
        of.into_iter().filter_map(robot).collect()
    }

    fn pair(robot: &str, topic: &str) -> (String, String) {
        (robot.to_owned(), topic.to_owned())
    }

    #[test]
    fn one_lidar_of_a_robot_is_read_and_the_option_that_reads_another_is_named() {
        let topics = [
            ("/a/scan_rear", LaserScan::NAME),
            ("/a/scan_front", LaserScan::NAME),
            ("/a/points", PointCloud2::NAME),
            ("/b/scan", LaserScan::NAME),
            ("/b/rear/scan", LaserScan::NAME),
            ("/c/base_scan", LaserScan::NAME),
            ("/lidar/front/scan", LaserScan::NAME),
        ];
        assert_eq!(chosen(&topics), [pair("a", "/a/scan_front"), pair("b", "/b/scan"), pair("c", "/c/base_scan")]);
        let channels: Vec<Channel> = topics.iter().map(|(topic, type_name)| channel(topic, type_name)).collect();
        let of = ScanTopics::new("/{robot}/scan", &channels.iter().collect::<Vec<_>>());
        let note = "of the lidars of a, the one on `/a/scan_front` is read, and not those on /a/scan_rear: \
                    `--rename /a/scan_rear=/a/scan` reads another";
        assert_eq!(of.note("a", "/a/scan_front").as_deref(), Some(note));
        assert_eq!([of.note("b", "/b/scan"), of.note("c", "/c/base_scan")], [None, None]);
    }

    #[test]
    fn one_cloud_of_a_robot_without_scans_is_read() {
        const CLOUD: &str = PointCloud2::NAME;
        let topics = [
            ("/a/scan", LaserScan::NAME),
            ("/a/velodyne_points", CLOUD),
            ("/b/ouster/points", CLOUD),
            ("/b/velodyne_points", CLOUD),
            ("/b/camera/depth/points", CLOUD),
            ("/c/ouster/points", "sensor_msgs/PointCloud2"),
            ("/d/scan", CLOUD),
            ("/d/points", CLOUD),
            ("/e/points", LaserScan::NAME),
            ("/f/cloud_registered", CLOUD),
            ("/front_camera2/points", CLOUD),
            ("/Lidar/points", CLOUD),
            ("/camel/points", CLOUD),
        ];
        let expected = [
            pair("a", "/a/scan"),
            pair("b", "/b/velodyne_points"),
            pair("c", "/c/ouster/points"),
            pair("d", "/d/scan"),
            pair("camel", "/camel/points"),
        ];
        assert_eq!(chosen(&topics), expected);
    }
}

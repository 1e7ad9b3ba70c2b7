//! The topics on which the lidars of robots publish.

use super::driver_topics::DriverTopics;
use super::scans::is_scan;
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{PointCloud2, RosMessage};
use gridweave_runtime::stage::match_robot;
use std::collections::BTreeSet;

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

/// The topics with the scans of robots: the one that the pipeline names, of scans or point clouds; for a robot that has
/// none, the first of [`LIDAR_CLOUDS`].
#[derive(Clone, Debug)]
pub(super) struct ScanTopics {
    /// The topic that the pipeline names, with `{robot}`.
    pattern: String,
    clouds: DriverTopics,
}

impl ScanTopics {
    /// Chooses the topics from the channels of logs.
    pub(super) fn new(pattern: &str, channels: &[&Channel]) -> Self {
        let mut topics = Self { pattern: pattern.to_owned(), clouds: DriverTopics::default() };
        let by_pattern: BTreeSet<&str> = channels.iter().filter_map(|channel| topics.robot(channel)).collect();
        let clouds = channels.iter().filter(|channel| full_type_name(&channel.schema_name) == PointCloud2::NAME);
        topics.clouds = DriverTopics::choose(&LIDAR_CLOUDS, clouds.map(|channel| channel.topic.as_str()));
        topics.clouds.retain(|robot| !by_pattern.contains(robot) && !is_sensor(robot));
        topics
    }

    /// The robot whose scans a channel holds.
    pub(super) fn robot<'a>(&self, channel: &'a Channel) -> Option<&'a str> {
        if channel.message_encoding != "cdr" || !is_scan(&full_type_name(&channel.schema_name)) {
            return None;
        }
        match_robot(&self.pattern, &channel.topic).or_else(|| self.clouds.robot(&channel.topic))
    }
}

/// Whether a name is that of a sensor, as in `/front_camera/points`, and not of a robot.
pub(super) fn is_sensor(name: &str) -> bool {
    const SENSORS: [&str; 16] = [
        "cam",
        "camera",
        "depth",
        "stereo",
        "rgbd",
        "realsense",
        "kinect",
        "zed",
        "oak",
        "sensor",
        "lidar",
        "laser",
        "velodyne",
        "ouster",
        "livox",
        "hesai",
    ];
    name.to_lowercase().split(|letter: char| !letter.is_alphabetic()).any(|word| SENSORS.contains(&word))
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

//! The quality of service that a log states for a topic, in the form of rosbag2.

use gridweave_runtime::ros::{OccupancyGrid, RobotFrames, RosMessage};
use std::collections::BTreeMap;

/// The key of a channel's metadata under which rosbag2 keeps it.
pub(crate) const KEY: &str = "offered_qos_profiles";

/// Reliable, and the last message is kept for those who come later (transient local), as map servers and static
/// transforms are sent.
///
/// Policies are the numbers of `rmw`, which every version of rosbag2 since Foxy reads, names being for later versions
/// only. The times stand for "without limit".
pub(crate) const LATCHED: &str = "\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";

/// The metadata of the channel of a result. Maps, static transforms and the poses of the robots' maps are latched; of
/// the others nothing is said, and a player takes its default.
pub(crate) fn metadata(topic: &str, ros_type: &str) -> BTreeMap<String, String> {
    let latched = [OccupancyGrid::NAME, RobotFrames::NAME].contains(&ros_type) || topic.ends_with("/tf_static");
    BTreeMap::from([(KEY.to_owned(), if latched { LATCHED.to_owned() } else { String::new() })])
}

/// Whether the metadata of a channel says that its last message is kept for those who come later.
pub(crate) fn is_transient_local(metadata: &BTreeMap<String, String>) -> bool {
    let offered = metadata.get(KEY).map_or("", String::as_str);
    // ROS 2 writes the durability as a number up to Iron, and as a word since.
    offered.lines().any(|line| matches!(line.trim(), "durability: 1" | "durability: transient_local"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_and_static_transforms_are_latched() {
        let of = |topic, ros_type| metadata(topic, ros_type)[KEY].clone();
        assert_eq!(of("/map", "nav_msgs/msg/OccupancyGrid"), LATCHED);
        assert_eq!(of("/frame_solver/frames", "gridweave_msgs/msg/RobotFrames"), LATCHED);
        assert_eq!(of("/tf_static", "tf2_msgs/msg/TFMessage"), LATCHED);
        assert_eq!(of("/tf", "tf2_msgs/msg/TFMessage"), "");
        assert_eq!(of("/robot1/lines/segments", "gridweave_msgs/msg/Segments"), "");
        assert!(is_transient_local(&metadata("/map", "nav_msgs/msg/OccupancyGrid")));
        assert!(!is_transient_local(&metadata("/tf", "tf2_msgs/msg/TFMessage")));
    }

    #[test]
    fn the_profile_is_a_list_of_one_with_the_numbers_of_rmw() {
        let profiles: Vec<BTreeMap<String, serde_json::Value>> = serde_norway::from_str(LATCHED).unwrap();
        let [profile] = profiles.as_slice() else { panic!("one profile") };
        assert_eq!(profile.len(), 9);
        let (reliable, transient_local, keep_last) = (1, 1, 1);
        assert_eq!(profile["reliability"], reliable);
        assert_eq!(profile["durability"], transient_local);
        assert_eq!(profile["history"], keep_last);
        assert_eq!(profile["lifespan"]["sec"], 9_223_372_036_u64);
    }
}

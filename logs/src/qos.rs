//! The quality of service of a topic, in rosbag2 format.

use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    MachineStages, MapAgreement, MapDeformation, MarkerArray, OccupancyGrid, Path, RobotFrames, RosMessage,
    SimulationTruth, TopologicalMap, Verdicts,
};
use std::collections::BTreeMap;

/// The metadata key of a channel under which rosbag2 stores it.
pub(crate) const KEY: &str = "offered_qos_profiles";

/// Reliable and transient local (latched), as map servers and static transforms publish.
///
/// Policies are written as numbers of `rmw`, which every rosbag2 since Foxy reads; only later ones read names. The
/// durations mean "unlimited".
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

/// Types that are published on change, and are valid until the next message.
const STATES: [&str; 10] = [
    MachineStages::NAME,
    MapAgreement::NAME,
    MapDeformation::NAME,
    MarkerArray::NAME,
    OccupancyGrid::NAME,
    Path::NAME,
    RobotFrames::NAME,
    SimulationTruth::NAME,
    TopologicalMap::NAME,
    Verdicts::NAME,
];

/// The metadata of a result's channel. Results that are valid until the next message, including static transforms, are
/// latched; for others nothing is set, and a player uses its default.
pub(crate) fn metadata(topic: &str, ros_type: &str) -> BTreeMap<String, String> {
    offered(is_latched_result(topic, ros_type))
}

/// Whether a result on a topic is valid until the next message, and so is latched.
pub fn is_latched_result(topic: &str, ros_type: &str) -> bool {
    STATES.contains(&ros_type) || topic.ends_with("/tf_static")
}

/// The metadata of a channel that is latched (`is_latched`), or has no quality of service.
pub fn offered(is_latched: bool) -> BTreeMap<String, String> {
    BTreeMap::from([(KEY.to_owned(), if is_latched { LATCHED.to_owned() } else { String::new() })])
}

/// Completes the quality of service of an input channel. Without it, maps and static transforms of a played log do not
/// reach subscribers that request transient local durability.
pub(crate) fn completed(mut channel: Channel) -> Channel {
    let is_needed = channel.message_encoding == "cdr"
        && (full_type_name(&channel.schema_name) == OccupancyGrid::NAME || channel.topic.ends_with("/tf_static"));
    if is_needed && channel.metadata.get(KEY).is_none_or(|offered| offered.trim().is_empty()) {
        channel.metadata.insert(KEY.to_owned(), LATCHED.to_owned());
    }
    channel
}

/// Whether the metadata of a channel contains transient local durability.
pub(crate) fn is_transient_local(metadata: &BTreeMap<String, String>) -> bool {
    let offered = metadata.get(KEY).map_or("", String::as_str);
    // ROS 2 writes the durability as a number up to Iron, and as a name since.
    offered.lines().any(|line| matches!(line.trim(), "durability: 1" | "durability: transient_local"))
}

/// The quality of service of a channel in a word or two; empty if unknown.
pub(crate) fn word(metadata: &BTreeMap<String, String>) -> &'static str {
    let offered = metadata.get(KEY).map_or("", String::as_str);
    let is_best_effort =
        offered.lines().any(|line| matches!(line.trim(), "reliability: 2" | "reliability: best_effort"));
    match (is_transient_local(metadata), is_best_effort, offered.trim().is_empty()) {
        (true, ..) => "latched",
        (false, true, _) => "best effort",
        (false, false, false) => "reliable",
        (false, false, true) => "",
    }
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
        assert_eq!(of("/robot1/merged_path", "nav_msgs/msg/Path"), LATCHED);
        assert_eq!(of("/tf", "tf2_msgs/msg/TFMessage"), "");
        assert_eq!(of("/robot1/lines/segments", "gridweave_msgs/msg/Segments"), "");
        assert!(is_transient_local(&metadata("/map", "nav_msgs/msg/OccupancyGrid")));
        assert!(!is_transient_local(&metadata("/tf", "tf2_msgs/msg/TFMessage")));
    }

    #[test]
    fn maps_and_static_transforms_of_the_input_are_latched_by_default() {
        let of = |topic: &str, schema_name: &str, offered: Option<&str>| {
            let metadata = offered.map(|offered| (KEY.to_owned(), offered.to_owned())).into_iter().collect();
            let (topic, schema_name) = (topic.to_owned(), schema_name.to_owned());
            let channel =
                Channel { topic, schema_name, message_encoding: "cdr".into(), metadata, ..Default::default() };
            completed(channel).metadata.get(KEY).cloned()
        };
        assert_eq!(of("/map", "nav_msgs/OccupancyGrid", None).as_deref(), Some(LATCHED));
        assert_eq!(of("/map", OccupancyGrid::NAME, Some("")).as_deref(), Some(LATCHED));
        assert_eq!(of("/map", OccupancyGrid::NAME, Some("theirs")).as_deref(), Some("theirs"));
        assert_eq!(of("/robot1/tf_static", "tf2_msgs/msg/TFMessage", None).as_deref(), Some(LATCHED));
        assert_eq!(of("/scan", "sensor_msgs/msg/LaserScan", None), None);
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

//! Maps of types that are not read.

use super::channels::RobotChannels;
use super::part_names::is_part;
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use std::collections::{BTreeMap, BTreeSet};

/// Types of maps that are not read, and what to record instead.
const TYPES: [(&str, &str); 6] = [
    ("octomap_msgs/msg/Octomap", OCTOMAP),
    ("octomap_msgs/msg/OctomapWithPose", OCTOMAP),
    ("grid_map_msgs/msg/GridMap", "the occupancy grid of one of its layers, which grid_map_visualization publishes"),
    ("cartographer_ros_msgs/msg/SubmapList", "the grid that cartographer_occupancy_grid_node makes of it, `map`"),
    ("nav2_msgs/msg/Costmap", "the grid beside it, `costmap`, or the `map` that it is made of"),
    ("rtabmap_msgs/msg/MapData", "the grid that rtabmap publishes beside it, `map`"),
];
const OCTOMAP: &str = "the grid that octomap_server projects from it, `projected_map`";

/// Words in the names of programs that make maps, and of what they publish, before which there may be no robot.
const PROGRAMS: [&str; 2] = ["map", "slam"];

/// What is said of a topic whose type is that of a map which is not read; `None` of others.
pub(crate) fn unread_map(topic: &str, type_name: &str) -> Option<String> {
    said(topic, type_name, "")
}

/// Robots whose maps are all of types that are not read, beside robots of which maps are read or built; each with what
/// is said of its maps. `pattern` is the topic of robots' maps. A robot with an occupancy grid on another topic is not
/// among them: that grid needs another name only.
pub(crate) fn robots_with_unread_maps<'a>(
    channels: impl Iterator<Item = &'a Channel> + Clone,
    roles: &RobotChannels,
    pattern: &str,
) -> BTreeMap<String, String> {
    let known: BTreeSet<&str> = roles.mapped().chain(roles.scanned()).collect();
    let mut unread = BTreeMap::new();
    if known.is_empty() {
        return unread;
    }
    let is_robot = |name: &str| {
        let name = name.to_lowercase();
        !is_part(&name) && !PROGRAMS.iter().any(|word| name.contains(word))
    };
    for channel in channels.clone() {
        let Some(robot) = roles.namespace(&channel.topic) else { continue };
        let is_grid = |other: &Channel| {
            full_type_name(&other.schema_name) == OccupancyGrid::NAME && !other.topic.contains("costmap")
        };
        let has_grid = || channels.clone().any(|other| is_grid(other) && roles.namespace(&other.topic) == Some(robot));
        let place = format!(", on `{}`", pattern.replace("{robot}", robot));
        if let Some(said) = said(&channel.topic, &channel.schema_name, &place)
            && !known.contains(robot)
            && is_robot(robot)
            && !has_grid()
        {
            unread.entry(robot.to_owned()).or_insert(said);
        }
    }
    unread
}

/// What is said of a topic, with the place where the map is to be recorded.
fn said(topic: &str, type_name: &str, place: &str) -> Option<String> {
    let type_name = full_type_name(type_name);
    let (_, instead) = TYPES.iter().find(|(known, _)| *known == type_name)?;
    Some(format!(
        "`{topic}` has {type_name}, which is not read as a map: record {instead} (nav_msgs/msg/OccupancyGrid){place}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::stage::RobotTopics;

    /// The robots with unread maps among channels, each with a topic and a type.
    fn unread(of: &[(&str, &str)]) -> BTreeMap<String, String> {
        let channel = |(topic, type_name): &(&str, &str)| Channel {
            topic: topic.to_string(),
            schema_name: type_name.to_string(),
            message_encoding: "cdr".to_owned(),
            ..Default::default()
        };
        let channels: Vec<Channel> = of.iter().map(channel).collect();
        let topics = RobotTopics::default();
        let pattern = topics.map.clone();
        let roles = RobotChannels::new(topics, channels.iter());
        robots_with_unread_maps(channels.iter(), &roles, &pattern)
    }

    #[test]
    fn a_robot_with_an_octomap_beside_the_map_of_another_is_named_with_the_cure() {
        const OCTOMAP: &str = "octomap_msgs/msg/Octomap";
        let map = ("/robot1/map", OccupancyGrid::NAME);
        let found = unread(&[map, ("/robot2/octomap_binary", OCTOMAP), ("/robot2/octomap_full", OCTOMAP)]);
        let said = "`/robot2/octomap_binary` has octomap_msgs/msg/Octomap, which is not read as a map: record the grid \
                    that octomap_server projects from it, `projected_map` (nav_msgs/msg/OccupancyGrid), on `/robot2/map`";
        assert_eq!(found, BTreeMap::from([("robot2".to_owned(), said.to_owned())]));
        assert!(unread(&[map, ("/robot2/map", OCTOMAP)]).contains_key("robot2"));
        for others in [
            &[("/robot1/octomap_binary", OCTOMAP)][..],
            &[("/octomap_binary", OCTOMAP), ("/octomap_server/octomap", OCTOMAP)],
            &[("/robot2/octomap_binary", OCTOMAP), ("/robot2/projected_map", OccupancyGrid::NAME)],
        ] {
            assert_eq!(unread(&[&[map], others].concat()), BTreeMap::new(), "{others:?}");
        }
        assert_eq!(unread(&[("/robot2/octomap_binary", OCTOMAP)]), BTreeMap::new(), "there is no other robot");
    }
}

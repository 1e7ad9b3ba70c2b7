//! Maps of types that are not read.

use crate::schemas::full_type_name;

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

/// What is said of a topic whose type is that of a map which is not read; `None` of others.
pub(crate) fn unread_map(topic: &str, type_name: &str) -> Option<String> {
    let type_name = full_type_name(type_name);
    let (_, instead) = TYPES.iter().find(|(known, _)| *known == type_name)?;
    Some(format!(
        "`{topic}` has {type_name}, which is not read as a map: record {instead} (nav_msgs/msg/OccupancyGrid)"
    ))
}

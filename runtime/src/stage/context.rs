//! The context of a stage: information about its pipeline, given when it is created.

use super::{InitialPoses, RunLinks, RunStatistics, TagFields};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Duration;

/// Information about its pipeline for a stage that is created.
#[derive(Clone, Debug, Default)]
pub struct Context {
    /// The stage's name in the pipeline.
    pub stage: String,
    /// The seed of the stage's randomness, derived from the pipeline's seed and the stage's name.
    pub seed: u64,
    /// The robot whose map frame is the world; if none, the first by name at the time when the first two maps are
    /// merged.
    pub reference: Option<String>,
    /// The topic patterns of the robots.
    pub robots: RobotTopics,
    /// The poses of robots' maps that the user knows; if there are any, that of the reference is among them.
    pub initial_poses: InitialPoses,
    /// The outputs wired to the stage, in the order of its wires: see [`Message::wire`](crate::message::Message::wire).
    pub inputs: Vec<InputWire>,
    /// The maximum time that a stage may work on one message; none if unlimited.
    pub stall_timeout: Option<Duration>,
    /// The statistics of the run, for a stage that shows them; none where the engine has none.
    pub statistics: Option<RunStatistics>,
    /// The links of the run, for a stage that forwards their messages; only on the engine `processes`.
    pub links: Option<RunLinks>,
}

impl Context {
    /// Whether anything is wired to the input port of the given name.
    pub fn is_wired(&self, port: &str) -> bool {
        self.inputs.iter().any(|wire| wire.port == port)
    }
}

/// An output of another stage that is wired to an input.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InputWire {
    /// The input port that it is wired to.
    pub port: &'static str,
    /// The stage that the output belongs to.
    pub from: String,
    /// The name of the output.
    pub output: &'static str,
    /// The ROS 2 type of its messages; empty for any.
    pub ros_type: String,
    /// The definition of that type in the format `ros2msg`; empty for types that Gridweave knows.
    pub definition: String,
    /// The topic of its messages in a log, with `{robot}` for the robot's name; empty if each message has its own
    /// topic, like those of a source.
    pub topic: String,
}

/// The topic patterns that assign the topics of a log to robots and roles. `{robot}` matches one part of a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotTopics {
    /// Occupancy grids.
    pub map: String,
    /// Poses of the robot's base in its map.
    pub pose: String,
    /// Range measurements of tags.
    pub tags: String,
    /// The fields with the measurements, for message types that Gridweave does not know.
    pub tag_fields: Option<TagFields>,
    /// Topological maps.
    pub topology: String,
    /// Scans of a lidar, used for robots without maps.
    pub scan: String,
    /// Poses from tf instead of from a pose topic.
    pub tf: Option<TfFrames>,
}

/// The two tf frames that define a robot's pose; `{robot}` is replaced by the robot's name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TfFrames {
    /// The frame of the robot's map.
    pub map_frame: String,
    /// The frame of the robot's base.
    pub base_frame: String,
}

impl Default for RobotTopics {
    fn default() -> Self {
        Self {
            map: "/{robot}/map".into(),
            pose: "/{robot}/pose".into(),
            tags: "/{robot}/tag_ranges".into(),
            tag_fields: None,
            topology: "/{robot}/topology".into(),
            scan: "/{robot}/scan".into(),
            tf: None,
        }
    }
}

/// Matches `text` against `pattern`, in which `{robot}` matches one part of a path. Returns the robot's name.
pub fn match_robot<'a>(pattern: &str, text: &'a str) -> Option<&'a str> {
    let (before, after) = pattern.split_once("{robot}")?;
    let robot = text.strip_prefix(before)?.strip_suffix(after)?;
    (!robot.is_empty() && !robot.contains('/')).then_some(robot)
}

/// The name of a robot's frame in the tf tree of all robots: the frame `map` of `robot1` becomes `robot1/map`. A frame
/// that starts with the robot's name already, such as `robot1/map` or `robot1_map`, is unchanged. The leading slash of
/// ROS 1 is removed.
///
/// Without a robot, and for a frame without a name, no prefix is added.
pub fn frame_of_robot<'a>(robot: &str, frame: &'a str) -> Cow<'a, str> {
    let frame = frame.trim_start_matches('/');
    let has_prefix = frame.strip_prefix(robot).is_some_and(|rest| robot.is_empty() || rest.starts_with(['/', '_']));
    match has_prefix || frame.is_empty() {
        true => Cow::Borrowed(frame),
        false => Cow::Owned(format!("{robot}/{frame}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_gets_its_robots_name_once() {
        for (robot, frame, expected) in [
            ("robot1", "map", "robot1/map"),
            ("robot1", "/map", "robot1/map"),
            ("robot1", "robot1/map", "robot1/map"),
            ("robot1", "robot1_map", "robot1_map"),
            ("robot1", "robot1", "robot1/robot1"),
            ("robot1", "robot12/map", "robot1/robot12/map"),
            ("robot1", "", ""),
            ("", "/map", "map"),
        ] {
            assert_eq!(frame_of_robot(robot, frame), expected, "{robot} {frame}");
            assert_eq!(frame_of_robot(robot, expected), expected);
        }
    }

    #[test]
    fn a_robot_is_one_part_of_a_topic() {
        assert_eq!(match_robot("/{robot}/map", "/robot1/map"), Some("robot1"));
        assert_eq!(match_robot("/fleet/{robot}/slam/map", "/fleet/r2/slam/map"), Some("r2"));
        assert_eq!(match_robot("{robot}/map", "robot1/map"), Some("robot1"));
        for other in ["/map", "//map", "/a/b/map", "/robot1/maps", "/robot1/pose", ""] {
            assert_eq!(match_robot("/{robot}/map", other), None, "{other}");
        }
    }
}

//! What a stage is told when it is made.

use super::{InitialPoses, RunLinks, RunStatistics, TagFields};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Duration;

/// What a stage is told of its pipeline when it is made.
#[derive(Clone, Debug, Default)]
pub struct Context {
    /// The stage's name in the pipeline.
    pub stage: String,
    /// Seeds the stage's randomness: made from the pipeline's seed and the stage's name.
    pub seed: u64,
    /// The robot whose map frame is the world; if none is given, the first by name when the first two are merged.
    pub reference: Option<String>,
    /// How topics are told apart.
    pub robots: RobotTopics,
    /// Where the user knows the maps of robots to lie; where there are any, that of the reference among them.
    pub initial_poses: InitialPoses,
    /// What is wired to the stage, in the order of its wires: see [`Message::wire`](crate::message::Message::wire).
    pub inputs: Vec<InputWire>,
    /// For how long a stage may work on one message; none for ever.
    pub stall_timeout: Option<Duration>,
    /// Tells what the stages of the run have done so far, for a stage that shows it; none where the engine does not know.
    pub statistics: Option<RunStatistics>,
    /// The links of the run, for a stage that shows elsewhere what passes on them; none where the engine keeps them to itself: all but
    /// `processes` do.
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
    /// The definition of that type, a text of the form `ros2msg`; empty if the stage that it comes from brings none, as those of all
    /// types that Gridweave knows do not.
    pub definition: String,
    /// The topic that its messages get in a log, with `{robot}` for the robot's name; empty if they bring topics of their
    /// own, as those of a source do.
    pub topic: String,
}

/// How the topics of a log are told apart: patterns in which `{robot}` stands for any one part of a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotTopics {
    /// Occupancy grids.
    pub map: String,
    /// Poses of the robot's base in its map.
    pub pose: String,
    /// Range readings of tags.
    pub tags: String,
    /// Where the readings are in messages of a type that is not known to hold some.
    pub tag_fields: Option<TagFields>,
    /// Topological maps.
    pub topology: String,
    /// Scans of a lidar, which count where a robot has no maps.
    pub scan: String,
    /// Poses from tf instead of from a pose topic.
    pub tf: Option<TfFrames>,
}

/// The two frames between which tf gives a robot's pose; `{robot}` stands for the robot's name.
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

/// Matches `text` with `pattern`, in which `{robot}` stands for one part of a path. Gives the robot's name.
pub fn match_robot<'a>(pattern: &str, text: &'a str) -> Option<&'a str> {
    let (before, after) = pattern.split_once("{robot}")?;
    let robot = text.strip_prefix(before)?.strip_suffix(after)?;
    (!robot.is_empty() && !robot.contains('/')).then_some(robot)
}

/// The name of a robot's frame in a tree of frames that holds all robots: the frame `map` of `robot1` is `robot1/map`. One that
/// bears the robot's name, as `robot1/map` and `robot1_map` do, has its name. The slash that ROS 1 puts before names goes.
///
/// Without a robot, and for a frame without a name, nothing is put before it.
pub fn frame_of_robot<'a>(robot: &str, frame: &'a str) -> Cow<'a, str> {
    let frame = frame.trim_start_matches('/');
    let bears_name = frame.strip_prefix(robot).is_some_and(|rest| robot.is_empty() || rest.starts_with(['/', '_']));
    match bears_name || frame.is_empty() {
        true => Cow::Borrowed(frame),
        false => Cow::Owned(format!("{robot}/{frame}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_bears_its_robots_name_once() {
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

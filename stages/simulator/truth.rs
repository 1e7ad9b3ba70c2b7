//! Truth for the evaluation of a merge.

use crate::shared::geometry::{Point2, Pose2};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{CommonPlace, Header, SimulationTruth, TrueFrame, TrueTag};

/// The truth of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Metres a cell of the first robot's map.
    pub resolution: f64,
    /// `T_robot1_robotN`: the pose of every robot's map frame in the first robot's map frame.
    pub frames: Vec<(String, Pose2)>,
    /// Where the tags are in the first robot's map frame, metres.
    pub tags: Vec<(String, Point2)>,
    /// The middle of each robot's last map, in its own map frame, metres.
    pub centres: Vec<(String, Point2)>,
    /// Points that the first two robots by name both have driven through, in the map of the first and in that of the
    /// second, each in its own map frame, metres.
    pub common: Vec<[Point2; 2]>,
}

impl Truth {
    /// The truth as a message.
    pub fn message(&self, log_time: LogTime) -> SimulationTruth {
        let first = self.frames.first().map_or("", |(robot, _)| robot);
        let frame = |(robot, pose): &(String, Pose2)| {
            let centre = self.centres.iter().find(|(name, _)| name == robot);
            TrueFrame {
                robot: robot.clone(),
                x: pose.translation.x,
                y: pose.translation.y,
                yaw: pose.rotation.angle(),
                centre: centre.map_or([0.0; 2], |(_, centre)| [centre.x, centre.y]),
            }
        };
        let tag = |(id, place): &(String, Point2)| TrueTag { tag_id: id.clone(), x: place.x, y: place.y };
        let common =
            |[first, second]: &[Point2; 2]| CommonPlace { first: first.coords.into(), second: second.coords.into() };
        SimulationTruth {
            header: Header::new(log_time, format!("{first}/map")),
            resolution: self.resolution,
            frames: self.frames.iter().map(frame).collect(),
            tags: self.tags.iter().map(tag).collect(),
            common: self.common.iter().map(common).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn the_message_contains_the_whole_truth() {
        let truth = Truth {
            resolution: 0.05,
            frames: vec![("robot1".into(), Pose2::identity()), ("robot2".into(), pose(1.0, 2.0, 0.5))],
            tags: vec![("tag00".into(), Point2::new(3.0, 4.0))],
            centres: vec![("robot1".into(), Point2::new(5.0, 6.0)), ("robot2".into(), Point2::new(7.0, 8.0))],
            common: vec![[Point2::new(1.0, 2.0), Point2::new(3.0, 4.0)]],
        };
        let frame = |robot: &str, [x, y, yaw]: [f64; 3], centre| TrueFrame { robot: robot.into(), x, y, yaw, centre };
        let expected = SimulationTruth {
            header: Header::new(LogTime(9), "robot1/map"),
            resolution: 0.05,
            frames: vec![frame("robot1", [0.0; 3], [5.0, 6.0]), frame("robot2", [1.0, 2.0, 0.5], [7.0, 8.0])],
            tags: vec![TrueTag { tag_id: "tag00".into(), x: 3.0, y: 4.0 }],
            common: vec![CommonPlace { first: [1.0, 2.0], second: [3.0, 4.0] }],
        };
        assert_eq!(truth.message(LogTime(9)), expected);
    }
}

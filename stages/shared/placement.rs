//! Transforms from the robots' maps into the merged frame: frames and deformations.

use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Point2, Pose2};
use gridweave_runtime::ros::{MapDeformation, RobotFrames};
use gridweave_runtime::stage::Output;
use std::collections::BTreeMap;

/// The latest frames, and the latest deformation of each map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placement {
    /// The frames.
    pub frames: RobotFrames,
    deformations: BTreeMap<String, Deformation>,
}

/// Pose and deformation of one robot's map in the world.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// `T_world_map`: the pose of the map frame in the world.
    pub transform_world_map: Pose2,
    /// Deformation of the map; none if it is rigid.
    pub deformation: Option<&'a Deformation>,
}

impl Placement {
    /// Stores a deformation in place of the robot's last, and returns whether it differs from that. Warns if it is
    /// not a lattice.
    pub fn keep_deformation<O>(&mut self, message: &MapDeformation, output: &Output<O>) -> bool {
        let robot = &message.robot;
        let Some(deformation) = Deformation::from_message(message) else {
            output.warn(format!("a deformation of the map of {robot} was left out: its nodes are not on a lattice"));
            return false;
        };
        self.deformations.insert(robot.clone(), deformation.clone()).is_none_or(|before| before != deformation)
    }

    /// Deformation of a robot's map; none if there was no message.
    pub fn deformation(&self, robot: &str) -> Option<&Deformation> {
        self.deformations.get(robot)
    }

    /// Poses and deformations of the maps of all placed robots, in the order of the frames.
    pub fn placed(&self) -> impl Iterator<Item = (&str, Placed<'_>)> {
        self.frames.frames.iter().map(|frame| {
            let robot = frame.robot.as_str();
            (
                robot,
                Placed { transform_world_map: frame.transform_reference_robot(), deformation: self.deformation(robot) },
            )
        })
    }
}

impl Placed<'_> {
    /// Transforms a pose in the map to the world: it is moved and turned with the map around it.
    pub fn in_world(&self, in_map: &Pose2) -> Pose2 {
        let place = Point2::from(in_map.translation.vector);
        let deformed = self.deformation.map_or(*in_map, |deformation| {
            Pose2::new(deformation.apply(&place).coords, in_map.rotation.angle() + deformation.turn(&place))
        });
        self.transform_world_map * deformed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use gridweave_runtime::ros::{DeformationNode, RobotFrame};

    #[test]
    fn a_pose_is_carried_and_turned_with_the_map_around_it() {
        let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)];
        let node =
            |(x, y)| DeformationNode { x, y, dx: 0.5, dyaw: if x > 0.0 { 0.02 } else { 0.0 }, ..Default::default() };
        let message = MapDeformation { spacing: 4.0, nodes: corners.map(node).to_vec(), ..Default::default() };
        let deformation = Deformation::from_message(&message).unwrap();
        let placed = Placed { transform_world_map: pose(10.0, 0.0, 1.0), deformation: Some(&deformation) };
        let (found, middle) = (placed.in_world(&pose(2.0, 2.0, 0.3)), deformation.apply(&Point2::new(2.0, 2.0)));
        assert!((found.translation.vector - (pose(10.0, 0.0, 1.0) * middle).coords).norm() < 1e-12);
        assert!((found.rotation.angle() - 1.31).abs() < 1e-12);
        let rigid = Placed { deformation: None, ..placed };
        assert_eq!(rigid.in_world(&pose(2.0, 2.0, 0.3)), pose(10.0, 0.0, 1.0) * pose(2.0, 2.0, 0.3));
    }

    #[test]
    fn robots_are_placed_as_the_frames_that_came_last_say() {
        let frame = RobotFrame { robot: "robot2".into(), x: 1.0, ..Default::default() };
        let placement =
            Placement { frames: RobotFrames { frames: vec![frame], ..Default::default() }, ..Placement::default() };
        let placed: Vec<_> = placement.placed().collect();
        assert_eq!((placed[0].0, placed[0].1.transform_world_map), ("robot2", pose(1.0, 0.0, 0.0)));
        assert!(placed.len() == 1 && placed[0].1.deformation.is_none() && placement.deformation("robot2").is_none());
    }
}

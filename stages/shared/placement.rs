//! Where what the robots have seen lies in the merged map: their frames, and how their maps are bent.

use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Point2, Pose2};
use gridweave_runtime::ros::{MapDeformation, RobotFrames};
use gridweave_runtime::stage::Output;
use std::collections::BTreeMap;

/// The frames that came last, and the last bend of each map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Placement {
    /// The frames.
    pub frames: RobotFrames,
    deformations: BTreeMap<String, Deformation>,
}

/// How one robot's map lies in the world.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// `T_world_map`: the pose of the map frame in the world.
    pub transform_world_map: Pose2,
    /// How the map is bent; none if it is rigid.
    pub deformation: Option<&'a Deformation>,
}

impl Placement {
    /// Keeps a bend in place of the robot's last, and says whether it differs from that. One that is no lattice is warned of.
    pub fn keep_deformation<O>(&mut self, message: &MapDeformation, output: &Output<O>) -> bool {
        let robot = &message.robot;
        let Some(deformation) = Deformation::from_message(message) else {
            output.warn(format!("how the map of {robot} is bent was left out: its nodes do not lie on a lattice"));
            return false;
        };
        self.deformations.insert(robot.clone(), deformation.clone()).is_none_or(|before| before != deformation)
    }

    /// How a robot's map is bent; none if nothing was said of it.
    pub fn deformation(&self, robot: &str) -> Option<&Deformation> {
        self.deformations.get(robot)
    }

    /// How the maps of all placed robots lie, by the order of the frames.
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
    /// Where a pose in the map lies in the world: it is carried and turned with the map around it.
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

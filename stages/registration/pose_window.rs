//! Relative poses of two maps that the user's initial poses allow.

use crate::shared::geometry::{Pose2, pose, turn_difference};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::stage::{InitialPose, InitialPoses};
use std::f64::consts::TAU;

/// Half width of the window, in standard deviations of the initial poses.
const DEVIATIONS: f64 = 3.0;

/// Relative poses of map b in map a that the initial poses of both robots allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseWindow {
    /// `T_a_b` by the initial poses.
    transform_a_b: Pose2,
    /// Largest distance of the origin of map b from there, metres.
    metres: f64,
    /// Largest rotation of map b from there, radians.
    radians: f64,
    /// Pose of map a in a merged map that it is a part of.
    transform_whole_a: Pose2,
    /// Pose of map b in a merged map that it is a part of.
    transform_whole_b: Pose2,
}

impl PoseWindow {
    /// Window of two robots with known initial poses.
    pub fn between(a: &InitialPose, b: &InitialPose) -> Self {
        let of = |at: &InitialPose| pose(at.x, at.y, at.yaw);
        let transform_a_b = of(a).inverse() * of(b);
        // A rotation of map a moves what is far from its origin.
        let by_turn = a.yaw_stddev * transform_a_b.translation.vector.norm();
        Self {
            transform_a_b,
            metres: DEVIATIONS * (a.stddev.powi(2) + b.stddev.powi(2) + by_turn.powi(2)).sqrt(),
            radians: DEVIATIONS * a.yaw_stddev.hypot(b.yaw_stddev),
            transform_whole_a: Pose2::identity(),
            transform_whole_b: Pose2::identity(),
        }
    }

    /// Window of a pair of robots; none unless both initial poses are known.
    pub fn of(pair: &RobotPair, poses: &InitialPoses) -> Option<Self> {
        Some(Self::between(poses.get(&pair.a)?, poses.get(&pair.b)?))
    }

    /// The same window for merged maps that map a and map b are parts of, at these poses.
    pub fn of_wholes(self, transform_whole_a: Pose2, transform_whole_b: Pose2) -> Self {
        Self { transform_whole_a, transform_whole_b, ..self }
    }

    /// Centre of the window: the relative pose by the initial poses.
    pub fn centre(&self) -> Pose2 {
        self.transform_whole_a * self.transform_a_b * self.transform_whole_b.inverse()
    }

    /// Whether a relative pose is in the window, widened by a margin in metres and radians.
    pub fn contains(&self, transform: &Pose2, metres: f64, radians: f64) -> bool {
        let (shift, turn) = self.change(transform);
        shift <= self.metres + metres && turn.abs() <= self.radians + radians
    }

    /// Distance of a relative pose from the centre, metres and radians.
    pub fn change(&self, transform: &Pose2) -> (f64, f64) {
        let transform_a_b = self.transform_whole_a.inverse() * transform * self.transform_whole_b;
        let shift = transform_a_b.translation.vector - self.transform_a_b.translation.vector;
        let turn = turn_difference(transform_a_b.rotation.angle(), self.transform_a_b.rotation.angle(), TAU);
        (shift.norm(), turn)
    }

    /// Whether a rotation is in the window, widened by a margin in radians.
    pub fn contains_yaw(&self, yaw: f64, radians: f64) -> bool {
        turn_difference(yaw, self.centre().rotation.angle(), TAU).abs() <= self.radians + radians
    }

    /// Standard deviations of the centre: metres along x and along y, and radians.
    pub fn deviations(&self) -> (f64, f64) {
        (self.metres / DEVIATIONS, self.radians / DEVIATIONS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn known(x: f64, y: f64, yaw: f64) -> InitialPose {
        InitialPose { x, y, yaw, ..InitialPose::default() }
    }

    #[test]
    fn a_window_is_three_deviations_wide() {
        let window = PoseWindow::between(&InitialPose::ORIGIN, &known(5.0, 3.0, 1.0));
        assert!(window.contains(&pose(7.9, 3.0, 1.5), 0.0, 0.0));
        assert!(!window.contains(&pose(8.1, 3.0, 1.0), 0.0, 0.0) && window.contains(&pose(8.1, 3.0, 1.0), 0.2, 0.0));
        assert!(!window.contains(&pose(5.0, 3.0, 1.7), 0.0, 0.0) && !window.contains_yaw(1.7, 0.0));
        assert!(window.contains_yaw(1.5 + TAU, 0.0) && window.contains_yaw(1.7, 0.2));
    }

    #[test]
    fn a_turn_of_the_first_map_moves_what_is_far_away() {
        let near = PoseWindow::between(&known(0.0, 0.0, 0.0), &known(1.0, 0.0, 0.0));
        let far = PoseWindow::between(&known(0.0, 0.0, 0.0), &known(50.0, 0.0, 0.0));
        assert!(near.deviations().0 < 1.5 && far.deviations().0 > 10.0);
    }

    proptest! {
        #[test]
        fn a_window_of_merged_maps_contains_the_same_poses_as_that_of_their_parts(
            [x, y, yaw] in [-9.0..9.0, -9.0..9.0, -3.0..3.0],
            [ax, ay, ayaw, bx, by, byaw] in [-9.0..9.0, -9.0..9.0, -3.0..3.0, -9.0..9.0, -9.0..9.0, -3.0..3.0],
        ) {
            let window = PoseWindow::between(&InitialPose::ORIGIN, &known(1.0, 2.0, 0.5));
            let (whole_a, whole_b) = (pose(ax, ay, ayaw), pose(bx, by, byaw));
            let wholes = window.of_wholes(whole_a, whole_b);
            let place = pose(x, y, yaw);
            let (shift, turn) = wholes.change(&(whole_a * place * whole_b.inverse()));
            let (expected, expected_turn) = window.change(&place);
            prop_assert!((shift - expected).abs() < 1e-9 && (turn - expected_turn).abs() < 1e-9);
            prop_assert!(wholes.change(&wholes.centre()).0 < 1e-9);
        }
    }
}

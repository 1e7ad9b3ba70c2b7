//! Where one map can lie on another by what the user knows of both.

use crate::shared::geometry::{Pose2, pose, turn_difference};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::stage::{InitialPose, InitialPoses};
use std::f64::consts::TAU;

/// A place is possible within so many standard deviations of what is known.
const DEVIATIONS: f64 = 3.0;

/// The places of a map b on a map a that the initial poses of both robots allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceWindow {
    /// `T_a_b` as it is known.
    transform_a_b: Pose2,
    /// How far the origin of map b may lie from there, metres.
    metres: f64,
    /// How much map b may be turned from there, radians.
    radians: f64,
    /// Where map a lies in a map that it is a part of.
    transform_whole_a: Pose2,
    /// Where map b lies in a map that it is a part of.
    transform_whole_b: Pose2,
}

impl PlaceWindow {
    /// Of two robots whose initial poses are known.
    pub fn between(a: &InitialPose, b: &InitialPose) -> Self {
        let of = |at: &InitialPose| pose(at.x, at.y, at.yaw);
        let transform_a_b = of(a).inverse() * of(b);
        // A turn of map a moves what is far from its origin.
        let by_turn = a.yaw_stddev * transform_a_b.translation.vector.norm();
        Self {
            transform_a_b,
            metres: DEVIATIONS * (a.stddev.powi(2) + b.stddev.powi(2) + by_turn.powi(2)).sqrt(),
            radians: DEVIATIONS * a.yaw_stddev.hypot(b.yaw_stddev),
            transform_whole_a: Pose2::identity(),
            transform_whole_b: Pose2::identity(),
        }
    }

    /// Of a pair of robots; none if it is not known of both where they lie.
    pub fn of(pair: &RobotPair, poses: &InitialPoses) -> Option<Self> {
        Some(Self::between(poses.get(&pair.a)?, poses.get(&pair.b)?))
    }

    /// The same window for maps of which map a and map b are parts, at these places.
    pub fn of_wholes(self, transform_whole_a: Pose2, transform_whole_b: Pose2) -> Self {
        Self { transform_whole_a, transform_whole_b, ..self }
    }

    /// What the user knows, without any doubt.
    pub fn middle(&self) -> Pose2 {
        self.transform_whole_a * self.transform_a_b * self.transform_whole_b.inverse()
    }

    /// Whether a place is in the window, with so many metres and radians to spare.
    pub fn contains(&self, transform: &Pose2, metres: f64, radians: f64) -> bool {
        let (shift, turn) = self.change(transform);
        shift <= self.metres + metres && turn.abs() <= self.radians + radians
    }

    /// How far a place lies from what is known, metres and radians.
    pub fn change(&self, transform: &Pose2) -> (f64, f64) {
        let transform_a_b = self.transform_whole_a.inverse() * transform * self.transform_whole_b;
        let shift = transform_a_b.translation.vector - self.transform_a_b.translation.vector;
        let turn = turn_difference(transform_a_b.rotation.angle(), self.transform_a_b.rotation.angle(), TAU);
        (shift.norm(), turn)
    }

    /// Whether a map that is turned by `yaw` can be in the window, with so many radians to spare.
    pub fn contains_yaw(&self, yaw: f64, radians: f64) -> bool {
        turn_difference(yaw, self.middle().rotation.angle(), TAU).abs() <= self.radians + radians
    }

    /// The standard deviations of what is known: metres in x and in y, and radians.
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
        let window = PlaceWindow::between(&InitialPose::ORIGIN, &known(5.0, 3.0, 1.0));
        assert!(window.contains(&pose(7.9, 3.0, 1.5), 0.0, 0.0));
        assert!(!window.contains(&pose(8.1, 3.0, 1.0), 0.0, 0.0) && window.contains(&pose(8.1, 3.0, 1.0), 0.2, 0.0));
        assert!(!window.contains(&pose(5.0, 3.0, 1.7), 0.0, 0.0) && !window.contains_yaw(1.7, 0.0));
        assert!(window.contains_yaw(1.5 + TAU, 0.0) && window.contains_yaw(1.7, 0.2));
    }

    #[test]
    fn a_turn_of_the_first_map_moves_what_is_far_away() {
        let near = PlaceWindow::between(&known(0.0, 0.0, 0.0), &known(1.0, 0.0, 0.0));
        let far = PlaceWindow::between(&known(0.0, 0.0, 0.0), &known(50.0, 0.0, 0.0));
        assert!(near.deviations().0 < 1.5 && far.deviations().0 > 10.0);
    }

    proptest! {
        #[test]
        fn a_window_of_wholes_holds_what_that_of_their_parts_does(
            [x, y, yaw] in [-9.0..9.0, -9.0..9.0, -3.0..3.0],
            [ax, ay, ayaw, bx, by, byaw] in [-9.0..9.0, -9.0..9.0, -3.0..3.0, -9.0..9.0, -9.0..9.0, -3.0..3.0],
        ) {
            let window = PlaceWindow::between(&InitialPose::ORIGIN, &known(1.0, 2.0, 0.5));
            let (whole_a, whole_b) = (pose(ax, ay, ayaw), pose(bx, by, byaw));
            let wholes = window.of_wholes(whole_a, whole_b);
            let place = pose(x, y, yaw);
            let (shift, turn) = wholes.change(&(whole_a * place * whole_b.inverse()));
            let (expected, expected_turn) = window.change(&place);
            prop_assert!((shift - expected).abs() < 1e-9 && (turn - expected_turn).abs() < 1e-9);
            prop_assert!(wholes.change(&wholes.middle()).0 < 1e-9);
        }
    }
}

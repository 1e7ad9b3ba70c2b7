//! Noise of the odometry of a robot, estimated from the scans that were registered.

use crate::shared::geometry::{Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector3};

/// Least standard deviation of odometry, even for a robot that stands still, metres and radians.
const LEAST_DEVIATION: [f64; 2] = [0.02, 0.01];
/// Steps that the assumption before the first step counts as.
const PRIOR_STEPS: f64 = 10.0;
/// Steps after which what was seen counts half as much: the ground and the load change.
const HALF_LIFE: f64 = 50.0;
/// Factor by which the deviation is assumed larger than the parameter, before the first step.
const PRIOR_FACTOR: f64 = 1.5;

/// Least root of the summed squares of the turns, radians, from which they show which way the scans turn, and the
/// correlation of both turns below which they turn against odometry.
const LEAST_TURNS: f64 = 1.0;
const OPPOSITE: f64 = -0.5;

/// How uncertain the steps of odometry are: standard deviations in proportion to the way and the turn, with factors
/// that are estimated from the steps so far.
#[derive(Clone, Debug, PartialEq)]
pub struct OdometryNoise {
    share: f64,
    steps: f64,
    /// Sums of squared deviations of the position and of the yaw, in the variances that were assumed.
    squares: [f64; 2],
    /// Sums of the squared turns by odometry, of those as registered, and of their products.
    turns: [f64; 3],
}

impl OdometryNoise {
    /// Noise of which nothing has been seen: `share` is the standard deviation as a share of the way and the turn.
    pub fn new(share: f64) -> Self {
        let squares = [PRIOR_STEPS * PRIOR_FACTOR * PRIOR_FACTOR; 2];
        Self { share, steps: PRIOR_STEPS, squares, turns: [0.0; 3] }
    }

    /// Standard deviations of a step, before any factor: of the position, metres, and of the yaw, radians.
    fn assumed(&self, moved: &Pose2) -> [f64; 2] {
        let (way, turn) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
        // Wheels that slip turn the robot along its path, too, and where it turns, its centre is not quite known.
        [self.share * (way + 0.5 * turn) + LEAST_DEVIATION[0], self.share * (turn + way) + LEAST_DEVIATION[1]]
    }

    /// Standard deviations of a step: of the position, metres, and of the yaw, radians.
    pub fn deviations(&self, moved: &Pose2) -> [f64; 2] {
        let [position, yaw] = self.assumed(moved);
        let factor = self.squares.map(|squares| (squares / self.steps).sqrt());
        [position * factor[0], yaw * factor[1]]
    }

    /// Inverse covariance (x, y, yaw) of a step.
    pub fn information(&self, moved: &Pose2) -> Matrix3<f64> {
        let [position, yaw] = self.deviations(moved).map(|deviation| deviation.powi(-2));
        Matrix3::from_diagonal(&Vector3::new(position, position, yaw))
    }

    /// Whether the robot turns one way by odometry and the other way by its scans.
    pub fn turns_against_scans(&self) -> bool {
        let [by_odometry, registered, both] = self.turns;
        by_odometry.sqrt() >= LEAST_TURNS && both < OPPOSITE * (by_odometry * registered).sqrt()
    }

    /// Learns from a step by odometry and the same step as registered, with its covariance. A step that no wall
    /// constrains is as odometry has it, but its covariance is that of odometry, so that it changes nothing
    /// (expectation maximisation).
    pub fn learn(&mut self, moved: &Pose2, registered: &Pose2, covariance: &Matrix3<f64>) {
        let [position, yaw] = self.assumed(moved);
        let off = registered.translation.vector - moved.translation.vector;
        let turned = wrap_angle(registered.rotation.angle() - moved.rotation.angle());
        let turns = [moved.rotation.angle(), registered.rotation.angle()];
        let products = [turns[0] * turns[0], turns[1] * turns[1], turns[0] * turns[1]];
        self.turns.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        let keep = 0.5f64.powf(1.0 / HALF_LIFE);
        self.steps = keep * self.steps + 1.0;
        // Two directions of the position are one step.
        self.squares[0] = keep * self.squares[0]
            + 0.5 * (off.norm_squared() + covariance.m11 + covariance.m22) / (position * position);
        self.squares[1] = keep * self.squares[1] + (turned * turned + covariance.m33) / (yaw * yaw);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn scans_that_turn_the_other_way_are_noticed() {
        let mut right = OdometryNoise::new(0.1);
        let mut mirrored = right.clone();
        for step in 0..40 {
            let turn = if step % 3 == 0 { -0.2 } else { 0.3 };
            right.learn(&pose(0.1, 0.0, turn), &pose(0.1, 0.0, turn + 0.1), &Matrix3::zeros());
            mirrored.learn(&pose(0.1, 0.0, turn), &pose(0.1, 0.0, 0.02 - turn), &Matrix3::zeros());
            assert!(step > 10 || !mirrored.turns_against_scans(), "a few turns tell nothing");
        }
        assert!(mirrored.turns_against_scans() && !right.turns_against_scans());
    }

    #[test]
    fn the_deviation_becomes_that_of_the_steps() {
        let mut noise = OdometryNoise::new(0.1);
        let moved = pose(1.0, 0.0, 0.0);
        let before = noise.deviations(&moved);
        for step in 0..400 {
            let off = if step % 2 == 0 { 0.03 } else { -0.03 };
            noise.learn(&moved, &pose(1.0 + off, off, off), &Matrix3::zeros());
        }
        let after = noise.deviations(&moved);
        assert!(before[0] > 0.15 && before[1] > 0.15, "{before:?}");
        assert!((after[0] - 0.03).abs() < 0.005 && (after[1] - 0.03).abs() < 0.005, "{after:?}");
        assert!(noise.deviations(&pose(2.0, 0.0, 0.0))[0] > 1.5 * after[0], "a longer way is less certain");
        assert!(noise.deviations(&Pose2::identity())[0] > 0.0);
    }
}

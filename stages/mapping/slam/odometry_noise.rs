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

/// How uncertain the steps of odometry are: standard deviations in proportion to the way and the turn, with factors
/// that are estimated from the steps so far.
#[derive(Clone, Debug, PartialEq)]
pub struct OdometryNoise {
    share: f64,
    steps: f64,
    /// Sums of squared deviations of the position and of the yaw, in the variances that were assumed.
    squares: [f64; 2],
}

impl OdometryNoise {
    /// Noise of which nothing has been seen: `share` is the standard deviation as a share of the way and the turn.
    pub fn new(share: f64) -> Self {
        let squares = [PRIOR_STEPS * PRIOR_FACTOR * PRIOR_FACTOR; 2];
        Self { share, steps: PRIOR_STEPS, squares }
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

    /// Learns from a step by odometry and the same step as registered, with its covariance. A step that no wall
    /// constrains is as odometry has it, but its covariance is that of odometry, so that it changes nothing
    /// (expectation maximisation).
    pub fn learn(&mut self, moved: &Pose2, registered: &Pose2, covariance: &Matrix3<f64>) {
        let [position, yaw] = self.assumed(moved);
        let off = registered.translation.vector - moved.translation.vector;
        let turned = wrap_angle(registered.rotation.angle() - moved.rotation.angle());
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

//! Bearings of a tag, averaged by the robot's position.

use super::position_groups::{Measurement, PositionGroup, PositionGroups};
use super::{Position, Ray};
use crate::shared::geometry::wrap_angle;
use nalgebra::Matrix2;

/// Largest difference of two bearings of one group, in standard deviations.
const SAME_BEARING: f64 = 4.0;
/// Least distance of a tag, metres: it bounds how much the bearing turns while the robot moves within one position.
const NEAREST: f64 = 0.5;

/// One bearing with the pose at which it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// Position of the sensor, and heading of its robot.
    pub position: Position,
    /// Direction to the tag, radians, map frame.
    pub bearing: f64,
    /// Standard deviation of the direction relative to the robot, radians.
    pub stddev: f64,
}

/// The bearings of one tag, averaged by position: the common error of the heading does not average out, as that of the
/// pose does not.
pub type BearingGroups = PositionGroups<BearingSums>;

/// Weighted sums over bearings.
#[derive(Clone, Copy, Debug, Default)]
pub struct BearingSums {
    /// The first bearing, radians: the others are relative to it, so that they do not wrap.
    first: f64,
    turn: f64,
    yaw_variance: f64,
}

impl Measurement for Bearing {
    type Sums = BearingSums;

    fn position(&self) -> &Position {
        &self.position
    }

    fn stddev(&self) -> f64 {
        self.stddev
    }

    fn no_sums(&self) -> BearingSums {
        BearingSums { first: self.bearing, turn: 0.0, yaw_variance: 0.0 }
    }

    fn add_to(&self, sums: &mut BearingSums, weight: f64) {
        sums.turn += wrap_angle(self.bearing - sums.first) * weight;
        sums.yaw_variance += self.position.yaw_variance * weight;
    }

    fn agrees(&self, group: &PositionGroup<BearingSums>, offset: f64) -> bool {
        wrap_angle(self.bearing - group.bearing()).abs() < SAME_BEARING * self.stddev + offset / NEAREST
    }
}

impl BearingGroups {
    /// One ray for each group: variance of the mean direction including that of the heading, and the variance of the
    /// position.
    ///
    /// `pose_stddev`, metres, and `heading_stddev`, radians, are lower bounds of the deviations of the pose and its
    /// heading. The pose counts with its largest variance in any direction, as in
    /// [`ReadingGroups::rings`](super::ReadingGroups::rings).
    pub fn rays(&self, pose_stddev: f64, heading_stddev: f64) -> impl Iterator<Item = Ray> + '_ {
        self.iter().map(move |group| Ray {
            origin: group.place(),
            bearing: group.bearing(),
            variance: group.variance(heading_stddev),
            origin_variance: group.pose_variance(pose_stddev),
        })
    }

    /// Common error of the poses, which moves the tag; see
    /// [`ReadingGroups::shared_covariance`](super::ReadingGroups::shared_covariance).
    pub fn shared_covariance(&self, heading_stddev: f64) -> Matrix2<f64> {
        self.mean_pose_covariance(|group| group.variance(heading_stddev))
    }
}

impl PositionGroup<BearingSums> {
    /// Mean direction, radians.
    fn bearing(&self) -> f64 {
        // Bearings with an infinite deviation have no weight.
        self.sums.first + self.sums.turn / self.weight.max(f64::MIN_POSITIVE)
    }

    /// Variance of the direction in the map, square radians.
    fn variance(&self, heading_stddev: f64) -> f64 {
        1.0 / self.weight + (self.sums.yaw_variance / self.weight).max(heading_stddev * heading_stddev)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::Point2;
    use std::f64::consts::PI;

    fn bearing(x: f64, bearing: f64) -> Bearing {
        Bearing { position: Position::new(Point2::new(x, 5.0)), bearing, stddev: 0.05 }
    }

    fn rays(bearings: &[Bearing], pose_stddev: f64, heading_stddev: f64) -> Vec<Ray> {
        let mut groups = BearingGroups::default();
        bearings.iter().for_each(|bearing| groups.add(bearing, 0.1));
        assert_eq!(groups.measurements() as usize, bearings.len());
        groups.rays(pose_stddev, heading_stddev).collect()
    }

    #[test]
    fn bearings_at_one_position_are_averaged_but_not_better_than_pose_and_heading() {
        // About the direction where angles wrap.
        let many: Vec<_> = (0..10_000).map(|n| bearing(1.0, if n % 2 == 0 { PI - 0.02 } else { 0.04 - PI })).collect();
        let found = rays(&many, 0.02, 0.01);
        assert_eq!(found.len(), 1);
        assert!(wrap_angle(found[0].bearing - (PI + 0.01)).abs() < 1e-9, "{found:?}");
        assert!((found[0].variance.sqrt() - 0.01).abs() < 1e-4 && (found[0].origin_variance - 0.0004).abs() < 1e-12);
    }

    #[test]
    fn the_variance_of_the_heading_is_added() {
        let position = Position { yaw_variance: 0.04, ..Position::new(Point2::origin()) };
        let found = rays(&[Bearing { position, ..bearing(0.0, 1.0) }], 0.0, 0.01);
        assert!((found[0].variance - (0.05f64.powi(2) + 0.04)).abs() < 1e-12, "{found:?}");
    }
}

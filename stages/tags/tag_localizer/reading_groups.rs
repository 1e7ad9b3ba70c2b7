//! Range readings of a tag, averaged by the robot's position.

use super::position_groups::{Measurement, PositionGroup, PositionGroups};
use super::{Position, Ring};
use nalgebra::Matrix2;

/// Largest difference of two readings of one group, in standard deviations.
const SAME_RANGE: f64 = 4.0;

/// One range reading with the pose at which it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Pose of the robot.
    pub position: Position,
    /// Distance to the tag, metres.
    pub range: f64,
    /// Standard deviation of the distance, metres.
    pub stddev: f64,
}

/// The readings of one tag, averaged by position; `f64` is their sum.
pub type ReadingGroups = PositionGroups<f64>;

impl Measurement for Reading {
    /// Of the ranges.
    type Sums = f64;

    fn position(&self) -> &Position {
        &self.position
    }

    fn stddev(&self) -> f64 {
        self.stddev
    }

    fn no_sums(&self) -> f64 {
        0.0
    }

    fn add_to(&self, sum: &mut f64, weight: f64) {
        *sum += self.range * weight;
    }

    fn agrees(&self, group: &PositionGroup<f64>, offset: f64) -> bool {
        (group.range() - self.range).abs() < SAME_RANGE * self.stddev + offset
    }
}

impl ReadingGroups {
    /// One ring for each group: variance of the mean range, and that of the pose, at most in any direction.
    /// `pose_stddev`, metres, is a lower bound of its deviation.
    pub fn rings(&self, pose_stddev: f64) -> impl Iterator<Item = Ring> + '_ {
        self.iter().map(move |group| Ring {
            centre: group.place(),
            radius: group.range(),
            variance: group.variance(pose_stddev),
        })
    }

    /// Common error of the poses, which moves the tag and does not average out over positions: their mean covariance,
    /// weighted by the information of each ring, square metres. Zeros if it is unknown.
    pub fn shared_covariance(&self, pose_stddev: f64) -> Matrix2<f64> {
        self.mean_pose_covariance(|group| group.variance(pose_stddev))
    }
}

impl PositionGroup<f64> {
    /// Mean distance to the tag, metres.
    fn range(&self) -> f64 {
        self.sums / self.weight
    }

    /// Variance of the distance between the position and the tag, square metres.
    fn variance(&self, pose_stddev: f64) -> f64 {
        1.0 / self.weight + self.pose_variance(pose_stddev)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::Point2;

    fn reading(x: f64, range: f64) -> Reading {
        Reading { position: Position::new(Point2::new(x, 5.0)), range, stddev: 0.05 }
    }

    fn rings(readings: &[Reading], min_travel: f64, pose_stddev: f64) -> Vec<Ring> {
        let mut groups = ReadingGroups::default();
        readings.iter().for_each(|reading| groups.add(reading, min_travel));
        groups.rings(pose_stddev).collect()
    }

    #[test]
    fn readings_of_a_robot_that_stands_still_are_no_better_than_its_pose() {
        let many = rings(&vec![reading(1.0, 2.0); 10_000], 0.05, 0.02);
        assert_eq!(many.len(), 1);
        assert!((many[0].variance.sqrt() - 0.02).abs() < 1e-4);
        assert!((many[0].radius - 2.0).abs() < 1e-9);
        assert!((many[0].centre - Point2::new(1.0, 5.0)).norm() < 1e-9);
    }

    #[test]
    fn a_position_ends_when_the_robot_has_moved_on() {
        let drive: Vec<_> = (0..10).map(|step| reading(0.03 * f64::from(step), 2.0)).collect();
        assert_eq!(rings(&drive, 0.05, 0.0).len(), 5, "two readings at each position");
        assert_eq!(rings(&drive, 0.0, 0.0).len(), 10, "every reading separately");
    }

    #[test]
    fn an_outlier_does_not_spoil_the_mean_of_its_position() {
        for order in [[2.0, 2.04, 0.7, 1.96], [0.7, 2.0, 2.04, 1.96]] {
            let found = rings(&order.map(|range| reading(0.0, range)), 0.05, 0.0);
            let radii: Vec<_> = found.iter().map(|ring| ring.radius).collect();
            assert_eq!(radii.len(), 2, "{radii:?}");
            assert!(radii.iter().any(|radius| (radius - 2.0).abs() < 1e-9), "{radii:?}");
        }
    }

    #[test]
    fn a_mean_is_weighted_by_the_readings_precision() {
        let mut coarse = reading(0.0, 2.1);
        coarse.stddev = 0.1;
        let found = rings(&[reading(0.0, 2.0), coarse], 0.05, 0.0);
        assert!((found[0].radius - 2.02).abs() < 1e-9);
        assert!((found[0].variance - 1.0 / 500.0).abs() < 1e-9);
    }
}

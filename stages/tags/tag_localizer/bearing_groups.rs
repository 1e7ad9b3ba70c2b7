//! Bearings of a tag, averaged by the robot's position.

use super::{Position, Ray};
use crate::shared::geometry::{Point2, wrap_angle};
use nalgebra::{Matrix2, Vector2};

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

/// The bearings of one tag, averaged by position.
///
/// As with [`ReadingGroups`](super::ReadingGroups), the common errors of the readings at one position do not average
/// out: those of the pose and of the heading. A bearing that contradicts the others at its position makes a separate
/// group, so that an outlier does not spoil a mean.
#[derive(Clone, Debug, Default)]
pub struct BearingGroups {
    groups: Vec<Group>,
    /// Index of the first group at the robot's present position.
    here: usize,
    bearings: u32,
}

/// Weighted sums over bearings. Positions and directions are relative to the first one, so that sums lose no digits
/// far from the origin, and directions do not wrap.
#[derive(Clone, Copy, Debug)]
struct Group {
    anchor: Point2,
    first_bearing: f64,
    weight: f64,
    offset: Vector2<f64>,
    turn: f64,
    pose_covariance: Matrix2<f64>,
    yaw_variance: f64,
}

impl BearingGroups {
    /// Adds a bearing. The robot is at a new position when it is `min_travel` metres or more away from the start of
    /// the last one.
    pub fn add(&mut self, reading: &Bearing, min_travel: f64) {
        self.bearings = self.bearings.saturating_add(1);
        let Bearing { position, bearing, stddev } = *reading;
        let place = self.groups.get(self.here).map(|group| group.anchor);
        if !place.is_some_and(|anchor| (position.place - anchor).norm() < min_travel) {
            self.here = self.groups.len();
        }
        let anchor = self.groups.get(self.here).map_or(position.place, |group| group.anchor);
        let offset = position.place - anchor;
        let gate = SAME_BEARING * stddev + offset.norm() / NEAREST;
        let is_same = |group: &&mut Group| wrap_angle(bearing - group.bearing()).abs() < gate;
        let found = self.groups[self.here..].iter_mut().find(is_same);
        let group = match found {
            Some(group) => group,
            None => {
                let (first_bearing, turn, weight, yaw_variance) = (bearing, 0.0, 0.0, 0.0);
                let (offset, pose_covariance) = (Vector2::zeros(), Matrix2::zeros());
                let last = self.groups.len();
                self.groups.push(Group { anchor, first_bearing, weight, offset, turn, pose_covariance, yaw_variance });
                &mut self.groups[last]
            }
        };
        let weight = 1.0 / (stddev * stddev);
        group.weight += weight;
        group.offset += offset * weight;
        group.turn += wrap_angle(bearing - group.first_bearing) * weight;
        group.pose_covariance += position.covariance * weight;
        group.yaw_variance += position.yaw_variance * weight;
    }

    /// Number of bearings.
    pub fn bearings(&self) -> u32 {
        self.bearings
    }

    /// One ray for each group: variance of the mean direction including that of the heading, and the variance of the
    /// position.
    ///
    /// `pose_stddev`, metres, and `heading_stddev`, radians, are lower bounds of the deviations of the pose and its
    /// heading. The pose counts with its largest variance in any direction, as in
    /// [`ReadingGroups::rings`](super::ReadingGroups::rings).
    pub fn rays(&self, pose_stddev: f64, heading_stddev: f64) -> impl Iterator<Item = Ray> + '_ {
        self.groups.iter().map(move |group| Ray {
            origin: group.anchor + group.offset / group.weight,
            bearing: group.bearing(),
            variance: group.variance(heading_stddev),
            origin_variance: (super::largest_variance(&group.pose_covariance) / group.weight)
                .max(pose_stddev * pose_stddev),
        })
    }

    /// Common error of the poses, which moves the tag; see
    /// [`ReadingGroups::shared_covariance`](super::ReadingGroups::shared_covariance).
    pub fn shared_covariance(&self, heading_stddev: f64) -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        let mut weights = 0.0;
        for group in &self.groups {
            let weight = 1.0 / group.variance(heading_stddev);
            sum += group.pose_covariance * (weight / group.weight);
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { sum }
    }
}

impl Group {
    fn bearing(&self) -> f64 {
        // Before its first bearing is added, a group has no weight.
        self.first_bearing + self.turn / self.weight.max(f64::MIN_POSITIVE)
    }

    /// Variance of the direction in the map, square radians.
    fn variance(&self, heading_stddev: f64) -> f64 {
        1.0 / self.weight + (self.yaw_variance / self.weight).max(heading_stddev * heading_stddev)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn bearing(x: f64, bearing: f64) -> Bearing {
        Bearing { position: Position::new(Point2::new(x, 5.0)), bearing, stddev: 0.05 }
    }

    fn rays(bearings: &[Bearing], pose_stddev: f64, heading_stddev: f64) -> Vec<Ray> {
        let mut groups = BearingGroups::default();
        bearings.iter().for_each(|bearing| groups.add(bearing, 0.1));
        assert_eq!(groups.bearings() as usize, bearings.len());
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

    #[test]
    fn a_position_ends_when_the_robot_has_moved_on() {
        let drive: Vec<_> = (0..10).map(|step| bearing(0.06 * f64::from(step), 1.0)).collect();
        assert_eq!(rays(&drive, 0.0, 0.0).len(), 5);
    }

    #[test]
    fn an_outlier_does_not_spoil_the_mean_of_its_position() {
        for order in [[1.0, 1.02, -2.0, 0.98], [-2.0, 1.0, 1.02, 0.98]] {
            let found = rays(&order.map(|angle| bearing(0.0, angle)), 0.0, 0.0);
            assert_eq!(found.len(), 2, "{found:?}");
            assert!(found.iter().any(|ray| (ray.bearing - 1.0).abs() < 1e-9), "{found:?}");
        }
    }
}

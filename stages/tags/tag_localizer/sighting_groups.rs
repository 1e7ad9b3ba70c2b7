//! Sightings of a tag, averaged by the robot's position.

use super::{Position, Ring, largest_variance};
use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};

/// A sighting of a tag by a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Pose of the robot.
    pub position: Position,
    /// Position of the tag, map frame, metres.
    pub seen: Point2,
    /// Standard deviation of the measurement, metres.
    pub stddev: f64,
}

/// The sightings of one tag, averaged by position.
///
/// As with [`ReadingGroups`](super::ReadingGroups), the common errors of the sightings at one position do not average
/// out: that of the pose and, in proportion to the distance of the tag, that of the heading.
#[derive(Clone, Debug, Default)]
pub struct SightingGroups {
    groups: Vec<Group>,
    sightings: u32,
}

/// Weighted sums over sightings. Positions are relative to the first one, so that sums lose no digits far from the
/// origin.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// Position of the robot at the first sighting.
    robot: Point2,
    /// Position of the tag at the first sighting.
    anchor: Point2,
    weight: f64,
    offset: Vector2<f64>,
    pose_covariance: Matrix2<f64>,
}

impl SightingGroups {
    /// Adds a sighting. The robot is at a new position when it is `min_travel` metres or more away from the start of
    /// the last one.
    pub fn add(&mut self, sighting: &Sighting, min_travel: f64) {
        self.sightings = self.sightings.saturating_add(1);
        let Sighting { position, seen, stddev } = *sighting;
        let weight = 1.0 / (stddev * stddev);
        let is_there = |group: &&mut Group| (position.place - group.robot).norm() < min_travel;
        let group = match self.groups.last_mut().filter(is_there) {
            Some(group) => group,
            None => {
                let (offset, pose_covariance) = (Vector2::zeros(), Matrix2::zeros());
                self.groups.push(Group { robot: position.place, anchor: seen, weight: 0.0, offset, pose_covariance });
                let last = self.groups.len() - 1;
                &mut self.groups[last]
            }
        };
        group.weight += weight;
        group.offset += (seen - group.anchor) * weight;
        group.pose_covariance += position.covariance * weight;
    }

    /// Number of sightings.
    pub fn sightings(&self) -> u32 {
        self.sightings
    }

    /// One ring of radius 0 for each group: the likelihood of a position falls with its distance from the sighting.
    ///
    /// `pose_stddev`, metres, is a lower bound of the deviation of the pose; `heading_stddev`, radians, that of its
    /// heading.
    pub fn rings(&self, pose_stddev: f64, heading_stddev: f64) -> impl Iterator<Item = Ring> + '_ {
        self.groups.iter().map(move |group| Ring {
            centre: group.seen(),
            radius: 0.0,
            variance: group.variance(pose_stddev, heading_stddev),
        })
    }

    /// Common error of the poses, which moves the tag; see
    /// [`ReadingGroups::shared_covariance`](super::ReadingGroups::shared_covariance).
    pub fn shared_covariance(&self, pose_stddev: f64, heading_stddev: f64) -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        let mut weights = 0.0;
        for group in &self.groups {
            let weight = 1.0 / group.variance(pose_stddev, heading_stddev);
            sum += group.pose_covariance * (weight / group.weight);
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { sum }
    }
}

impl Group {
    fn seen(&self) -> Point2 {
        self.anchor + self.offset / self.weight
    }

    /// Variance of the sighting along any direction, square metres.
    fn variance(&self, pose_stddev: f64, heading_stddev: f64) -> f64 {
        let pose_variance = largest_variance(&self.pose_covariance) / self.weight;
        let across = heading_stddev * (self.seen() - self.robot).norm();
        1.0 / self.weight + pose_variance.max(pose_stddev * pose_stddev) + across * across
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(x: f64, seen: (f64, f64)) -> Sighting {
        Sighting { position: Position::new(Point2::new(x, 5.0)), seen: Point2::new(seen.0, seen.1), stddev: 0.1 }
    }

    fn rings(sightings: &[Sighting]) -> Vec<Ring> {
        let mut groups = SightingGroups::default();
        sightings.iter().for_each(|sighting| groups.add(sighting, 0.1));
        assert_eq!(groups.sightings() as usize, sightings.len());
        groups.rings(0.02, 0.01).collect()
    }

    #[test]
    fn sightings_at_one_position_are_averaged_but_not_better_than_pose_and_heading() {
        let many: Vec<_> = (0..10_000).map(|n| sighting(1.0, (3.0 + 0.1 * f64::from(n % 2), 5.0))).collect();
        let found = rings(&many);
        assert_eq!((found.len(), found[0].radius), (1, 0.0));
        assert!((found[0].centre - Point2::new(3.05, 5.0)).norm() < 1e-9);
        let least = 0.02f64.powi(2) + (0.01f64 * 2.05).powi(2);
        assert!((found[0].variance - least).abs() < 1e-5, "{}", found[0].variance);
    }

    #[test]
    fn a_position_ends_when_the_robot_has_moved_on() {
        let drive: Vec<_> = (0..10).map(|step| sighting(0.06 * f64::from(step), (3.0, 5.0))).collect();
        assert_eq!(rings(&drive).len(), 5);
    }

    #[test]
    fn a_mean_is_weighted_by_the_precision_of_sightings() {
        let coarse = Sighting { stddev: 0.2, ..sighting(0.0, (3.5, 5.0)) };
        let found = rings(&[sighting(0.0, (3.0, 5.0)), coarse]);
        assert!((found[0].centre.x - 3.1).abs() < 1e-9);
    }
}

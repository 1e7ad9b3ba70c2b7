//! Sightings of a tag, averaged by the robot's position.

use super::position_groups::{Measurement, PositionGroup, PositionGroups};
use super::{Position, Ring};
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

/// The sightings of one tag, averaged by position: the common error of the heading does not average out, in proportion
/// to the distance of the tag.
pub type SightingGroups = PositionGroups<SightingSums>;

/// Weighted sums over sightings.
#[derive(Clone, Copy, Debug, Default)]
pub struct SightingSums {
    /// Position of the tag at the first sighting.
    first: Point2,
    /// Of the positions relative to that.
    offset: Vector2<f64>,
}

impl Measurement for Sighting {
    type Sums = SightingSums;

    fn position(&self) -> &Position {
        &self.position
    }

    fn stddev(&self) -> f64 {
        self.stddev
    }

    fn no_sums(&self) -> SightingSums {
        SightingSums { first: self.seen, offset: Vector2::zeros() }
    }

    fn add_to(&self, sums: &mut SightingSums, weight: f64) {
        sums.offset += (self.seen - sums.first) * weight;
    }

    /// All sightings at one position are averaged.
    fn agrees(&self, _: &PositionGroup<SightingSums>, _: f64) -> bool {
        true
    }
}

impl SightingGroups {
    /// One ring of radius 0 for each group: the likelihood of a position falls with its distance from the sighting.
    ///
    /// `pose_stddev`, metres, is a lower bound of the deviation of the pose; `heading_stddev`, radians, that of its
    /// heading.
    pub fn rings(&self, pose_stddev: f64, heading_stddev: f64) -> impl Iterator<Item = Ring> + '_ {
        self.iter().map(move |group| Ring {
            centre: group.seen(),
            radius: 0.0,
            variance: group.variance(pose_stddev, heading_stddev),
        })
    }

    /// Common error of the poses, which moves the tag; see
    /// [`ReadingGroups::shared_covariance`](super::ReadingGroups::shared_covariance).
    pub fn shared_covariance(&self, pose_stddev: f64, heading_stddev: f64) -> Matrix2<f64> {
        self.mean_pose_covariance(|group| group.variance(pose_stddev, heading_stddev))
    }
}

impl PositionGroup<SightingSums> {
    /// Mean position of the tag.
    fn seen(&self) -> Point2 {
        self.sums.first + self.sums.offset / self.weight
    }

    /// Variance of the sighting along any direction, square metres.
    fn variance(&self, pose_stddev: f64, heading_stddev: f64) -> f64 {
        let across = heading_stddev * (self.seen() - self.anchor).norm();
        1.0 / self.weight + self.pose_variance(pose_stddev) + across * across
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
        assert_eq!(groups.measurements() as usize, sightings.len());
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
}

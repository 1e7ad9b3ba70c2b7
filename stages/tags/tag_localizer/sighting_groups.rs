//! Positions at which a tag was seen, those of one place joined.

use super::{Position, Ring, largest_variance};
use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};

/// A tag that was seen at a position, as a camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Where the robot was.
    pub position: Position,
    /// Where the tag was seen, map frame, metres.
    pub seen: Point2,
    /// Standard deviation of where it was seen from there, metres.
    pub stddev: f64,
}

/// The sightings of one tag, those of one place joined to their mean.
///
/// As with [`ReadingGroups`](super::ReadingGroups), what the readings of one place have in common does not average out: the
/// error of the pose and, the farther off the tag is seen the more, that of the heading.
#[derive(Clone, Debug, Default)]
pub struct SightingGroups {
    groups: Vec<Group>,
    sightings: u32,
}

/// Weighted sums over sightings. Positions are taken from the first one, so that sums lose nothing far from the origin.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// Where the robot was at the first sighting.
    robot: Point2,
    /// Where the tag was at the first sighting.
    anchor: Point2,
    weight: f64,
    offset: Vector2<f64>,
    pose_covariance: Matrix2<f64>,
}

impl SightingGroups {
    /// Adds the next sighting. The robot is at another place than before when it is `min_travel` metres or more away
    /// from where the last place began.
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

    /// The number of sightings.
    pub fn sightings(&self) -> u32 {
        self.sightings
    }

    /// One ring a group, of radius 0: the chance of a place falls with its distance from where the tag was seen.
    ///
    /// `pose_stddev`, metres, is the least that the pose counts with; `heading_stddev`, radians, what its heading does.
    pub fn rings(&self, pose_stddev: f64, heading_stddev: f64) -> impl Iterator<Item = Ring> + '_ {
        self.groups.iter().map(move |group| Ring {
            centre: group.seen(),
            radius: 0.0,
            variance: group.variance(pose_stddev, heading_stddev),
        })
    }

    /// The error that the poses may have in common, which moves the tag; see
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

    /// Variance of where the tag was seen, along any direction, square metres.
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
    fn sightings_of_one_place_give_their_mean_and_never_more_than_pose_and_heading_allow() {
        let many: Vec<_> = (0..10_000).map(|n| sighting(1.0, (3.0 + 0.1 * f64::from(n % 2), 5.0))).collect();
        let found = rings(&many);
        assert_eq!((found.len(), found[0].radius), (1, 0.0));
        assert!((found[0].centre - Point2::new(3.05, 5.0)).norm() < 1e-9);
        let least = 0.02f64.powi(2) + (0.01f64 * 2.05).powi(2);
        assert!((found[0].variance - least).abs() < 1e-5, "{}", found[0].variance);
    }

    #[test]
    fn a_place_ends_when_the_robot_has_gone_on() {
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

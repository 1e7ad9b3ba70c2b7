//! A lidar that scans in the plane.
//!
//! The model: beams are spread evenly over the field of view, a full circle from straight ahead on, or a sector about
//! it. A beam meets the first solid in its direction; its range has Gaussian noise of constant deviation. A beam that
//! meets nothing within the lidar's reach, and one in so many at random, returns nothing. The robot does not move
//! during a scan.

use super::ray_caster::RayCaster;
use crate::shared::geometry::{Point2, Pose2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// A lidar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lidar {
    /// Beams of one scan.
    pub(super) beams: usize,
    /// The angle over which they are spread, radians.
    pub(super) field_of_view: f64,
    /// The longest range, metres.
    pub(super) reach: f64,
    /// Standard deviation of a range, metres.
    pub(super) noise: f64,
    /// Share of the beams that return nothing, 0 to 1.
    pub(super) dropped: f64,
}

/// One beam that has returned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beam {
    /// Its direction from the robot's heading, radians.
    pub(super) angle: f64,
    /// What was measured, metres.
    pub(super) range: f64,
}

impl Lidar {
    /// The direction of the first beam from the robot's heading, radians.
    pub(super) fn first_angle(&self) -> f64 {
        match self.field_of_view < TAU {
            true => 0.5 * self.field_of_view * (1.0 / self.beams as f64 - 1.0),
            false => 0.0,
        }
    }

    /// Scans the true world from a pose in the building; puts the beams that return into `beams`.
    pub(super) fn scan(&self, world: &RayCaster, pose: &Pose2, random: &mut impl Rng, beams: &mut Vec<Beam>) {
        beams.clear();
        let origin = Point2::from(pose.translation.vector);
        let heading = pose.rotation.angle();
        let first = self.first_angle();
        for beam in 0..self.beams {
            // Both draws are made for every beam, so that what one beam meets does not change the noise of the others.
            let dropped = random.random::<f64>() < self.dropped;
            let noise: f64 = random.sample(StandardNormal);
            let angle = first + self.field_of_view * beam as f64 / self.beams as f64;
            if let Some(range) = world.cast(&origin, heading + angle, self.reach)
                && !dropped
            {
                beams.push(Beam { angle, range: (range + self.noise * noise).max(0.0) });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use crate::simulator::shape::{Rectangle, Solid};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn scan(lidar: &Lidar) -> Vec<Beam> {
        let wall = Solid::from(Rectangle::new(3.0, -50.0, 3.2, 50.0));
        let behind = Solid::from(Rectangle::new(-4.0, -1.0, -3.8, 1.0));
        let mut beams = Vec::new();
        let world = RayCaster::new(&[wall, behind]);
        lidar.scan(&world, &pose(0.0, 0.0, 0.5), &mut ChaCha8Rng::seed_from_u64(1), &mut beams);
        beams
    }

    #[test]
    fn beams_meet_the_wall_within_the_noise_and_none_beyond_the_reach() {
        let beams = scan(&Lidar { beams: 3600, field_of_view: TAU, reach: 10.0, noise: 0.02, dropped: 0.0 });
        let errors: Vec<f64> = beams
            .iter()
            .map(|beam| (beam, (0.5 + beam.angle).cos()))
            .filter(|(_, cosine)| *cosine > 0.0)
            .map(|(beam, cosine)| beam.range - 3.0 / cosine)
            .collect();
        let deviation = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((deviation - 0.02).abs() < 0.002, "{deviation}");
        assert!(beams.iter().all(|beam| beam.range < 10.1));
    }

    #[test]
    fn the_beams_of_a_sector_are_symmetric_about_straight_ahead() {
        let beams = scan(&Lidar { beams: 100, field_of_view: 1.0, reach: 30.0, noise: 0.0, dropped: 0.0 });
        let angles: Vec<f64> = beams.iter().map(|beam| beam.angle).collect();
        assert_eq!(angles.len(), 100);
        assert!((angles[0] + 0.495).abs() < 1e-9 && (angles[99] - 0.495).abs() < 1e-9, "{angles:?}");
    }

    #[test]
    fn as_many_beams_are_dropped_as_asked() {
        let all = scan(&Lidar { beams: 3600, field_of_view: TAU, reach: 10.0, noise: 0.0, dropped: 0.0 }).len() as f64;
        let some =
            scan(&Lidar { beams: 3600, field_of_view: TAU, reach: 10.0, noise: 0.0, dropped: 0.25 }).len() as f64;
        assert!((some / all - 0.75).abs() < 0.03);
    }
}

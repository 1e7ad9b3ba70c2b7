//! A lidar that scans in the plane.
//!
//! The model: beams are spread evenly over the full circle, the first one straight ahead. A beam meets the first solid
//! in its direction; its range has Gaussian noise of constant deviation. A beam that meets nothing within the lidar's
//! reach, and one in so many at random, returns nothing. The robot does not move during a scan.

use super::ray_caster::RayCaster;
use crate::geometry::{Point2, Pose2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// A lidar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lidar {
    /// Beams of one scan.
    pub beams: usize,
    /// The longest range, metres.
    pub reach: f64,
    /// Standard deviation of a range, metres.
    pub noise: f64,
    /// Share of the beams that return nothing, 0 to 1.
    pub dropped: f64,
}

/// One beam that has returned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Its direction from the robot's heading, radians.
    pub angle: f64,
    /// What was measured, metres.
    pub range: f64,
}

impl Lidar {
    /// Scans the true world from a pose in the building; puts the beams that return into `beams`.
    pub fn scan(&self, world: &RayCaster, pose: &Pose2, random: &mut impl Rng, beams: &mut Vec<Beam>) {
        beams.clear();
        let origin = Point2::from(pose.translation.vector);
        let heading = pose.rotation.angle();
        for beam in 0..self.beams {
            // Both draws are made for every beam, so that what one beam meets does not change the noise of the others.
            let dropped = random.random::<f64>() < self.dropped;
            let noise: f64 = random.sample(StandardNormal);
            let angle = TAU * beam as f64 / self.beams as f64;
            if let Some(range) = world.cast(&origin, heading + angle, self.reach)
                && !dropped
            {
                beams.push(Beam { angle, range: (range + self.noise * noise).max(0.0) });
            }
        }
    }
}

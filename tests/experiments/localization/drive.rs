//! Drives past a tag.

use gridweave_stages::shared::geometry::Point2;
use nalgebra::{Rotation2, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Range of a tag, metres (Tsardoulias et al., section 3).
pub(super) const REACH: f64 = 3.0;
/// A drive has so many readings, as many as figure 4 shows at most.
pub(super) const READINGS: usize = 300;
/// The way from one reading to the next, metres.
pub(super) const SPACING: f64 = 0.01;
/// The whole way, metres.
pub(super) const WAY: f64 = READINGS as f64 * SPACING;

/// The shape of a drive of 3 m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Drive {
    /// A straight line.
    Straight,
    /// A quarter of a circle, of 1.9 m radius.
    Curved,
    /// A whole circle, of 0.5 m radius.
    Circling,
}

impl Drive {
    /// All of them.
    pub(super) const ALL: [Self; 3] = [Self::Straight, Self::Curved, Self::Circling];

    /// What tables call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Curved => "curved",
            Self::Circling => "circling",
        }
    }

    /// Where the robot is after a way, from the origin along the x axis at first; metres.
    fn place(self, way: f64) -> Point2 {
        let along_circle = |radius: f64| {
            let angle: f64 = way / radius;
            Point2::new(radius * angle.sin(), radius * (1.0 - angle.cos()))
        };
        match self {
            Self::Straight => Point2::new(way, 0.0),
            Self::Curved => along_circle(WAY / FRAC_PI_2),
            Self::Circling => along_circle(WAY / TAU),
        }
    }
}

/// A drive and a tag that is within reach all the way.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    /// Where the robot is at each reading, metres.
    pub(super) places: Vec<Point2>,
    /// Where the tag is, metres.
    pub(super) tag: Point2,
}

impl Scene {
    /// A drive from any place in any direction, and a tag anywhere in reach.
    pub(super) fn new(drive: Drive, random: &mut ChaCha8Rng) -> Self {
        let heading = Rotation2::new(TAU * random.random::<f64>());
        let start = Vector2::new(random.random(), random.random());
        let places: Vec<Point2> =
            (0..READINGS).map(|reading| heading * drive.place(SPACING * reading as f64) + start).collect();
        let tag = loop {
            let offset = Vector2::new(random.random::<f64>(), random.random::<f64>()) * 2.0 - Vector2::repeat(1.0);
            let tag = places[0] + offset * REACH;
            if places.iter().all(|place| (tag - place).norm() <= REACH) {
                break tag;
            }
        };
        Self { places, tag }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn readings_are_a_centimetre_of_way_apart_and_the_tag_is_in_reach() {
        for drive in Drive::ALL {
            let scene = Scene::new(drive, &mut ChaCha8Rng::seed_from_u64(1));
            assert_eq!(scene.places.len(), READINGS);
            for pair in scene.places.windows(2) {
                let step = (pair[1] - pair[0]).norm();
                assert!((step - SPACING).abs() < 1e-5, "{step}");
            }
            assert!(scene.places.iter().all(|place| (place - scene.tag).norm() <= REACH));
        }
    }

    #[test]
    fn a_circling_robot_comes_back() {
        let scene = Scene::new(Drive::Circling, &mut ChaCha8Rng::seed_from_u64(1));
        assert!((scene.places[0] - scene.places[READINGS - 1]).norm() < 1.01 * SPACING);
    }
}

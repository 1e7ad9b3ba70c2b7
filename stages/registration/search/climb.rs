//! From a place to the peak near it.

use super::Place;
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::{UnitComplex, Vector3};

/// A place that still gets better after so many rounds is a slope, not a peak.
const MOST_ROUNDS: usize = 16;

/// How far is gone at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    /// In x and in y, metres.
    pub metres: f64,
    /// In rotation, radians.
    pub radians: f64,
    /// How often both are halved before the peak is found.
    pub halvings: usize,
}

/// Goes from `start` wherever the score gets better, in steps to either side in x, in y, and in rotation about `centre`,
/// a point in frame a.
pub fn climb(score: impl Fn(&Pose2) -> f64, start: &Pose2, centre: &Point2, steps: Steps) -> Place {
    let mut best = Place { transform_a_b: *start, score: score(start) };
    let Steps { mut metres, mut radians, halvings } = steps;
    let mut halved = 0;
    for _ in 0..MOST_ROUNDS {
        let from = best;
        for axis in 0..3 {
            let beside = |direction: f64| {
                let mut step = Vector3::zeros();
                step[axis] = direction * if axis == 2 { radians } else { metres };
                let transform_a_b = moved(&best.transform_a_b, centre, &step);
                Place { transform_a_b, score: score(&transform_a_b) }
            };
            let (left, right) = (beside(-1.0), beside(1.0));
            let better = if right.score > left.score { right } else { left };
            if better.score > best.score {
                best = better;
            }
        }
        if best == from {
            if halved == halvings {
                break;
            }
            (metres, radians, halved) = (0.5 * metres, 0.5 * radians, halved + 1);
        }
    }
    best
}

/// A transform after a shift, and a turn about a place in frame a: metres and radians.
pub(super) fn moved(transform_a_b: &Pose2, centre: &Point2, step: &Vector3<f64>) -> Pose2 {
    let turn = UnitComplex::new(step.z);
    let arm = turn * (transform_a_b.translation.vector - centre.coords);
    Pose2::from_parts((centre.coords + arm + step.xy()).into(), turn * transform_a_b.rotation)
}

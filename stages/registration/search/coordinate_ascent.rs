//! Coordinate ascent from a pose to the peak near it.

use super::ScoredPose;
use super::overlay::Overlay;
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::{UnitComplex, Vector3};

/// Most rounds. A pose that still improves is on a slope, not near a peak.
const MOST_ROUNDS: usize = 16;
/// Number of halvings of the steps when a peak is refined.
const HALVINGS: usize = 3;

/// Step sizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    /// In x and in y, metres.
    pub metres: f64,
    /// In rotation, radians.
    pub radians: f64,
    /// Number of halvings of both.
    pub halvings: usize,
}

/// Maximizes a score by steps in x, in y, and in rotation about `centre`, a point in frame a, starting at `start`.
pub fn coordinate_ascent(score: impl Fn(&Pose2) -> f64, start: &Pose2, centre: &Point2, steps: Steps) -> ScoredPose {
    let mut best = ScoredPose { transform_a_b: *start, score: score(start) };
    let Steps { mut metres, mut radians, halvings } = steps;
    let mut halved = 0;
    // Steps that are known to be no better from the best pose, by axis: to the left, and to the right.
    let mut is_worse = [[false; 2]; 3];
    for _ in 0..MOST_ROUNDS {
        let from = best;
        for axis in 0..3 {
            let step = if axis == 2 { radians } else { metres };
            let beside = [-step, step].map(|step| {
                let mut change = Vector3::zeros();
                change[axis] = step;
                moved(&best.transform_a_b, centre, &change)
            });
            let mut better = None;
            for (side, transform_a_b) in beside.into_iter().enumerate() {
                if !std::mem::replace(&mut is_worse[axis][side], true) {
                    let beside = ScoredPose { transform_a_b, score: score(&transform_a_b) };
                    let least = better.map_or(best.score, |(_, better): (usize, ScoredPose)| better.score);
                    better = if beside.score > least { Some((side, beside)) } else { better };
                }
            }
            if let Some((side, beside)) = better {
                best = beside;
                // The step back leads to where it came from.
                is_worse = [[false; 2]; 3];
                is_worse[axis][1 - side] = true;
            }
        }
        if best == from {
            if halved == halvings {
                break;
            }
            (metres, radians, halved) = (0.5 * metres, 0.5 * radians, halved + 1);
            is_worse = [[false; 2]; 3];
        }
    }
    best
}

/// Applies a shift and a turn about a point in frame a, metres and radians.
pub(super) fn moved(transform_a_b: &Pose2, centre: &Point2, step: &Vector3<f64>) -> Pose2 {
    let turn = UnitComplex::new(step.z);
    let arm = turn * (transform_a_b.translation.vector - centre.coords);
    Pose2::from_parts((centre.coords + arm + step.xy()).into(), turn * transform_a_b.rotation)
}

/// Refines a pose to the peak of the smooth score near it, to an eighth of a cell of the overlay and of `radians`.
/// Rotations are about `centre`, the centroid of the walls in common, in frame a.
pub fn refine_peak(overlay: &Overlay<'_>, transform_a_b: &Pose2, centre: &Point2, radians: f64) -> Pose2 {
    let steps = Steps { metres: overlay.a.cell, radians, halvings: HALVINGS };
    coordinate_ascent(|pose| overlay.smooth_score(pose), transform_a_b, centre, steps).transform_a_b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use std::cell::RefCell;

    #[test]
    fn the_top_is_found_and_no_pose_is_scored_twice_at_one_step() {
        let scored: RefCell<Vec<Pose2>> = RefCell::default();
        let score = |at: &Pose2| {
            scored.borrow_mut().push(*at);
            let (x, y, yaw) = (at.translation.x, at.translation.y, at.rotation.angle());
            -(x - 1.3).powi(2) - (y + 0.6).powi(2) - (yaw - 0.2).powi(2)
        };
        let steps = Steps { metres: 0.1, radians: 0.05, halvings: 0 };
        let found = coordinate_ascent(score, &pose(1.0, -0.2, 0.0), &Point2::new(1.0, 0.0), steps);
        let (x, y, yaw) = (
            found.transform_a_b.translation.x,
            found.transform_a_b.translation.y,
            found.transform_a_b.rotation.angle(),
        );
        assert!((x - 1.3).abs() < 0.051 && (y + 0.6).abs() < 0.051 && (yaw - 0.2).abs() < 0.026, "{found:?}");
        let scored = scored.into_inner();
        let is_same = |one: &Pose2, other: &Pose2| {
            let change = one.inverse() * other;
            change.translation.vector.norm() < 1e-9 && change.rotation.angle().abs() < 1e-9
        };
        let again = scored.iter().enumerate().filter(|(at, one)| scored[..*at].iter().any(|two| is_same(one, two)));
        assert_eq!(again.count(), 0);
    }
}

//! A finer search round a place that is known roughly.

use super::MapAlignerParameters;
use super::raster::{Content, Raster};
use crate::geometry::{Point2, Pose2};
use nalgebra::{Matrix3, Vector3};

/// Steps to either side, in x, y and rotation, that are tried at once.
const REACH: i32 = 2;
/// A place that still gets better after so many rounds is a slope, not a peak.
const MOST_ROUNDS: usize = 8;

/// The place near `transform_a_b` at which two fine rasters fit best, as far as steps of one cell and of
/// `fine_rotation_step` about `centre`, a point in frame a, lead to it.
pub fn refine_peak(
    a: &Raster,
    b: &Raster,
    transform_a_b: &Pose2,
    centre: &Point2,
    parameters: &MapAlignerParameters,
) -> Pose2 {
    let (walls_a, walls_b): (Vec<Point2>, Vec<Point2>) = (a.wall_cells().collect(), b.wall_cells().collect());
    let penalty = parameters.free_space_penalty;
    let score = |place: &Pose2| {
        let back = place.inverse();
        let of_b: f64 = walls_b.iter().map(|wall| value(a.at(&(place * wall)), penalty)).sum();
        let of_a: f64 = walls_a.iter().map(|wall| value(b.at(&(back * wall)), penalty)).sum();
        of_a + of_b
    };
    let mut best = *transform_a_b;
    let mut best_score = score(&best);
    for _ in 0..MOST_ROUNDS {
        let round_centre = best;
        for step in steps() {
            let place = moved(&round_centre, centre, &step, a.cell, parameters.fine_rotation_step);
            let score = score(&place);
            if score > best_score {
                (best, best_score) = (place, score);
            }
        }
        if best == round_centre {
            break;
        }
    }
    best
}

/// The covariance of (x, y, yaw) of a place that is known to one step of the finer search in the middle of the walls in
/// common: with the cells of the maps and the bends that drift has put into them, no more is certain.
pub(super) fn covariance(
    transform_a_b: &Pose2,
    centre: &Point2,
    cell: f64,
    parameters: &MapAlignerParameters,
) -> Matrix3<f64> {
    let arm = transform_a_b.translation.vector - centre.coords;
    let jacobian = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
    let variances = Vector3::new(cell, cell, parameters.fine_rotation_step).map(|deviation| deviation * deviation);
    jacobian * Matrix3::from_diagonal(&variances) * jacobian.transpose()
}

/// What a wall counts that meets this in the other map.
fn value(content: Content, penalty: f64) -> f64 {
    match content {
        Content::Wall => 1.0,
        Content::BesideWall => 0.5,
        Content::Free => -penalty,
        Content::Unknown => 0.0,
    }
}

/// Steps in x, y and rotation, the short ones first.
fn steps() -> Vec<Vector3<f64>> {
    let axis = || -REACH..=REACH;
    let all = axis().flat_map(|x| axis().flat_map(move |y| axis().map(move |turn| (x, y, turn))));
    let mut all: Vec<(i32, i32, i32)> = all.collect();
    all.sort_by_key(|(x, y, turn)| x * x + y * y + turn * turn);
    all.into_iter().map(|(x, y, turn)| Vector3::new(x, y, turn).map(f64::from)).collect()
}

/// A transform after steps of a shift and of a turn about a place in frame a.
fn moved(transform_a_b: &Pose2, centre: &Point2, step: &Vector3<f64>, cell: f64, rotation_step: f64) -> Pose2 {
    let turn = nalgebra::UnitComplex::new(step.z * rotation_step);
    let arm = turn * (transform_a_b.translation.vector - centre.coords);
    let translation = centre.coords + arm + step.xy() * cell;
    Pose2::from_parts(translation.into(), turn * transform_a_b.rotation)
}

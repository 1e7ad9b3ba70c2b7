//! Covariance of a pose from the shape of its peak.

use super::coordinate_ascent::moved;
use super::overlay::{CommonWalls, Overlay};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Variance in a direction as a share of the squared width of the peak, where the width is that of a parabola of the
/// same curvature, from its top to its foot. Fitted to the errors in simulated and real maps.
const VARIANCE_OF_WIDTH: f64 = 0.01;

/// Least standard deviation of a point in the middle of the common walls, in cells of the overlay, for the offset of
/// the two maps' cells and for deformation by drift.
const LEAST_DEVIATION: f64 = 0.25;

/// The covariance of (x, y, yaw) of `T_a_b` at a peak, metres and radians.
///
/// Along a direction in which the score does not fall, as along a corridor, the standard deviation is that of a
/// position anywhere along the common walls.
pub fn covariance(overlay: &Overlay<'_>, transform_a_b: &Pose2, common: &CommonWalls) -> Matrix3<f64> {
    let step = overlay.a.cell;
    // A turn is scaled to how far it moves the walls.
    let radius = common.radius.max(step);
    let score = |x: i32, y: i32, turn: i32| {
        let step = Vector3::new(f64::from(x) * step, f64::from(y) * step, f64::from(turn) * step / radius);
        overlay.smooth_score(&moved(transform_a_b, &common.centre, &step))
    };
    let mut scores = [[[0.0; 3]; 3]; 3];
    for (x, plane) in (-1..).zip(&mut scores) {
        for (y, line) in (-1..).zip(plane) {
            for (turn, value) in (-1..).zip(line) {
                *value = score(x, y, turn);
            }
        }
    }
    let at = |place: [usize; 3]| scores[place[0]][place[1]][place[2]];
    let mut curvature = Matrix3::zeros();
    for one in 0..3 {
        for other in 0..3 {
            curvature[(one, other)] = if one == other { second(&at, one) } else { mixed(&at, one, other) };
        }
    }
    let top = at([1, 1, 1]).max(f64::MIN_POSITIVE);
    let shape = SymmetricEigen::new(-curvature / (top * step * step));
    let least = (LEAST_DEVIATION * step).powi(2);
    let variances = shape.eigenvalues.map(|curvature| {
        let most = radius * radius;
        // A parabola `1 - curvature * d^2 / 2` has its foot at the square root of `2 / curvature`.
        let variance = VARIANCE_OF_WIDTH * 2.0 / curvature;
        least + if variance > 0.0 { variance.min(most) } else { most }
    });
    let about_centre = shape.eigenvectors * Matrix3::from_diagonal(&variances) * shape.eigenvectors.transpose();
    let arm = transform_a_b.translation.vector - common.centre.coords;
    let per_radian = 1.0 / radius;
    let jacobian = Matrix3::new(1.0, 0.0, -arm.y * per_radian, 0.0, 1.0, arm.x * per_radian, 0.0, 0.0, per_radian);
    jacobian * about_centre * jacobian.transpose()
}

/// Second difference along an axis, the mean over all lines.
fn second(at: &impl Fn([usize; 3]) -> f64, axis: usize) -> f64 {
    mean(|place| {
        let value = |along: usize| {
            let mut place = place;
            place[axis] = along;
            at(place)
        };
        value(0) - 2.0 * value(1) + value(2)
    })
}

/// Mixed second difference along two axes, the mean over all planes.
fn mixed(at: &impl Fn([usize; 3]) -> f64, one: usize, other: usize) -> f64 {
    mean(|place| {
        let value = |along_one: usize, along_other: usize| {
            let mut place = place;
            (place[one], place[other]) = (along_one, along_other);
            at(place)
        };
        0.25 * (value(2, 2) - value(2, 0) - value(0, 2) + value(0, 0))
    })
}

/// Mean over all points of the stencil.
fn mean(difference: impl Fn([usize; 3]) -> f64) -> f64 {
    let places = (0..27).map(|number| [number / 9, number / 3 % 3, number % 3]);
    places.map(difference).sum::<f64>() / 27.0
}

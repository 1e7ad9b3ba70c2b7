//! ICP: moves map b until its walls are aligned with those of map a.

use super::iteration::Iteration;
use super::{IcpParameters, InitialGuess};
use crate::shared::geometry::{Point2, Pose2};
use crate::shared::walls::{WallMap, stride};
use nalgebra::{Matrix3, Vector3};

/// Iterations after which a pose may come again, and how near, as a share of the last motion.
const LONGEST_CYCLE: usize = 12;
const CYCLE_DEVIATION: f64 = 0.01;
/// At most this many rotations to either side of the first guess are tried.
const MOST_STARTS: usize = 10;

/// Result of a registration.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// `T_a_b`, refined: `T_icp * T_initial` (Tsardoulias et al., equations 10 to 13).
    pub transform_a_b: Pose2,
    /// Whether the last iteration moved the points by less than the bound.
    pub converged: bool,
    /// Number of iterations from the best start.
    pub iterations: usize,
    /// For each iteration, the root of the weighted mean of the squared residuals before its step, metres.
    pub errors: Vec<f64>,
    /// Number of points of map b that have a partner in map a.
    pub inliers: usize,
    /// Weighted mean of the squared residuals of the last iteration, square metres.
    pub mean_square_error: f64,
    /// Information on (x, y, yaw) from the maps only: the inverse of a covariance, which need not exist. In a bare
    /// corridor it is zero along the corridor.
    pub information: Matrix3<f64>,
    /// Covariance of (x, y, yaw), metres and radians, from the maps and the first guess together.
    pub covariance: Matrix3<f64>,
    /// Centroid of the common section, frame a.
    pub centre: Point2,
    /// Covariance of the position of that centroid and of the turn about it (x, y, yaw), metres and radians.
    pub centre_covariance: Matrix3<f64>,
    /// Root mean square distance of the paired points from the centroid, metres.
    pub radius: f64,
    /// Mahalanobis distance from the first guess, slack included.
    pub step: f64,
}

/// Registers map b on map a, starting at the first guess.
///
/// Only points near each other count (the common section of section 4.3). The first guess is a prior with its
/// covariance, so what the maps do not constrain, such as the position along a bare corridor, stays as in the first
/// guess.
///
/// Far from the centre of the maps a small turn moves a wall by more than the distance to the next wall. So where the
/// first guess's rotation is uncertain, several rotations are tried on a sample of the points, and the one with most
/// inliers is continued.
pub fn register(a: &WallMap, b: &WallMap, initial_guess: &InitialGuess, parameters: &IcpParameters) -> Registration {
    let mut iteration = Iteration::new(a, b, initial_guess, parameters);
    let stride = stride(b.walls.points().len(), parameters.coarse_points);
    let mut best: Option<(f64, Pose2, Vec<f64>)> = None;
    for start in starts(&mut iteration, initial_guess, stride, parameters) {
        let (transform_a_b, errors) = draw_near(&mut iteration, start, stride, parameters);
        let matched = iteration.matched(&transform_a_b, stride);
        if best.as_ref().is_none_or(|(most, ..)| matched > *most) {
            best = Some((matched, transform_a_b, errors));
        }
    }
    let (mut transform_a_b, mut errors) =
        best.map_or((initial_guess.transform_a_b, Vec::new()), |(_, transform, errors)| (transform, errors));
    let last_motion = settle(&mut iteration, &mut transform_a_b, &mut errors);
    let converged = last_motion.is_some_and(|motion| motion < parameters.convergence);
    iteration.measure_by_lines(&transform_a_b);
    let state = iteration.into_state();
    let frame = state.frame;
    // If the iterations oscillate between partners, the uncertainty is at least the amplitude.
    let unsettled = if converged { 0.0 } else { last_motion.map_or(0.0, |motion| motion.powi(2)) };
    let covariance = state.covariance + Matrix3::from_diagonal_element(unsettled);
    let (jacobian, inverse) = (frame.jacobian(&transform_a_b), frame.inverse_jacobian(&transform_a_b));
    let metres_to_radians = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / frame.scale));
    Registration {
        transform_a_b,
        converged,
        iterations: errors.len(),
        errors,
        inliers: state.inliers,
        mean_square_error: state.mean_square_error,
        information: inverse.transpose() * state.information * inverse,
        covariance: jacobian * covariance * jacobian.transpose(),
        centre: frame.centre,
        centre_covariance: metres_to_radians * covariance * metres_to_radians,
        radius: frame.scale,
        step: initial_guess.distance(&transform_a_b, &frame, parameters),
    }
}

/// Iterates on all points at the least distance until they hardly move, or come back to where they were. Returns how
/// far they moved last, root mean square, metres.
fn settle(iteration: &mut Iteration<'_>, transform_a_b: &mut Pose2, errors: &mut Vec<f64>) -> Option<f64> {
    let parameters = iteration.parameters;
    let mut motions = Vec::new();
    for _ in 0..parameters.max_iterations {
        let Some(change) = iteration.run(transform_a_b, parameters.min_distance, 1) else { break };
        *transform_a_b = change.transform_a_b;
        errors.push(iteration.error());
        motions.push(change.motion);
        if change.motion.norm() < parameters.convergence || is_cycle(&motions) {
            break;
        }
    }
    motions.last().map(Vector3::norm)
}

/// Whether the last motions lead back to a pose before them, as where points alternate between partners.
fn is_cycle(motions: &[Vector3<f64>]) -> bool {
    let Some(last) = motions.last() else { return false };
    let within = CYCLE_DEVIATION * last.norm();
    let sums = motions.iter().rev().take(LONGEST_CYCLE).scan(Vector3::zeros(), |sum: &mut Vector3<f64>, motion| {
        *sum += motion;
        Some(sum.norm())
    });
    sums.skip(1).any(|distance| distance < within)
}

/// Iterates on a sample of the points while the distance of partners shrinks. Returns the transform and the error of
/// each iteration, metres.
fn draw_near(
    iteration: &mut Iteration<'_>,
    start: Pose2,
    stride: usize,
    parameters: &IcpParameters,
) -> (Pose2, Vec<f64>) {
    let (mut transform_a_b, mut distance, mut errors) = (start, parameters.max_distance, Vec::new());
    while distance > parameters.min_distance {
        let Some(change) = iteration.run(&transform_a_b, distance, stride) else { break };
        transform_a_b = change.transform_a_b;
        distance *= parameters.shrink;
        errors.push(iteration.error());
    }
    (transform_a_b, errors)
}

/// The first guess; where its rotation is uncertain, also the same turned about the centroid of the common section,
/// up to two standard deviations to either side.
fn starts(
    iteration: &mut Iteration<'_>,
    initial_guess: &InitialGuess,
    stride: usize,
    parameters: &IcpParameters,
) -> Vec<Pose2> {
    let initial = initial_guess.transform_a_b;
    let deviation = initial_guess.covariance.m33.sqrt();
    let count = (2.0 * deviation / parameters.start_spacing).round() as usize;
    let mut starts = vec![initial];
    if count > 0 {
        let frame = iteration.common_section(&initial, stride);
        for side in 1..=count.min(MOST_STARTS) {
            let turn = side as f64 * parameters.start_spacing * frame.scale;
            starts.extend([turn, -turn].map(|turn| frame.moved(&initial, &Vector3::new(0.0, 0.0, turn))));
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alternating_motions_are_a_cycle_and_shrinking_ones_are_not() {
        let motions = |ratio: f64| -> Vec<Vector3<f64>> {
            (0..20).map(|number| 0.01 * ratio.powi(number) * Vector3::new(1.0, -0.3, 0.1)).collect()
        };
        assert!(is_cycle(&motions(-1.0)) && !is_cycle(&motions(-1.0)[..1]) && !is_cycle(&[]));
        for ratio in [-0.9, -0.7, 0.5, 0.95] {
            let shrinking = motions(ratio);
            assert!((0..=20).all(|count| !is_cycle(&shrinking[..count])), "{ratio}");
        }
        let around = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]].map(|[x, y]| Vector3::new(x, y, 0.0));
        assert!(is_cycle(&around) && !is_cycle(&around[..3]));
    }
}

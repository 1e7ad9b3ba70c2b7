//! Weighted least squares over the pose graph.

use super::graph::Edge;
use super::uncertain::{UncertainPose, error_vector};
use crate::shared::geometry::{Pose2, pose, relative_pose, wrap_angle};
use nalgebra::{DMatrix, DVector, Dyn, Matrix3, OMatrix, U3, Vector3};

/// The most Gauss-Newton steps.
const STEPS: usize = 30;
/// A step that changes no metre and no radian by more than this is the last.
const CONVERGED: f64 = 1e-10;

/// Minimizes the squared errors of all edges, weighted by their inverse covariances (Gauss-Newton on SE(2)), and
/// computes the covariances from the normal equations.
///
/// `poses` are `T_root_robot`, `None` for robots that take no part; edges to such robots are ignored. The root is
/// fixed and known exactly. `None` if the equations have no solution: the given poses are then the best available.
pub fn optimize(poses: &[Option<UncertainPose>], edges: &[Edge], root: usize) -> Option<Vec<Option<UncertainPose>>> {
    let mut estimate: Vec<Option<Pose2>> = poses.iter().map(|pose| pose.map(|pose| pose.pose)).collect();
    let mut unknown = vec![None; poses.len()];
    let mut count = 0;
    for (robot, _) in poses.iter().enumerate().filter(|(robot, pose)| *robot != root && pose.is_some()) {
        unknown[robot] = Some(3 * count);
        count += 1;
    }
    if count == 0 {
        return Some(poses.to_vec());
    }
    let mut terms = Vec::with_capacity(edges.len());
    for edge in edges.iter().filter(|edge| estimate[edge.a].is_some() && estimate[edge.b].is_some()) {
        terms.push((edge, edge.transform_a_b.covariance.cholesky()?.inverse()));
    }
    for _ in 0..STEPS {
        let mut hessian = DMatrix::zeros(3 * count, 3 * count);
        let mut gradient = DVector::zeros(3 * count);
        for (edge, information) in &terms {
            let (Some(pose_a), Some(pose_b)) = (estimate[edge.a], estimate[edge.b]) else { continue };
            let (error, by_a, by_b) = linearize(edge, &pose_a, &pose_b);
            let ends = [(unknown[edge.a], by_a), (unknown[edge.b], by_b)];
            for (row, by_row) in ends.iter().filter_map(|(place, by)| place.map(|place| (place, by))) {
                let weighted = by_row.transpose() * information;
                let mut part = gradient.fixed_rows_mut::<3>(row);
                part += weighted * error;
                for (column, by_column) in ends.iter().filter_map(|(place, by)| place.map(|place| (place, by))) {
                    let mut block = hessian.fixed_view_mut::<3, 3>(row, column);
                    block += weighted * by_column;
                }
            }
        }
        let normal_equations = hessian.cholesky()?;
        let step = -normal_equations.solve(&gradient);
        for (pose_now, place) in estimate.iter_mut().zip(&unknown) {
            if let (Some(now), Some(place)) = (pose_now, place) {
                let yaw = wrap_angle(now.rotation.angle() + step[place + 2]);
                *now = pose(now.translation.x + step[*place], now.translation.y + step[place + 1], yaw);
            }
        }
        let largest = step.amax();
        if !largest.is_finite() {
            return None;
        }
        if largest <= CONVERGED {
            return assemble(&estimate, &unknown, &normal_equations.unpack());
        }
    }
    None
}

/// Squared Mahalanobis distance of an edge from the poses of its ends. Infinite if its covariance has no inverse.
pub fn squared_deviation(edge: &Edge, pose_a: &Pose2, pose_b: &Pose2) -> f64 {
    let (error, _, _) = linearize(edge, pose_a, pose_b);
    let squared = edge.transform_a_b.covariance.cholesky().map(|cholesky| error.dot(&cholesky.solve(&error)));
    squared.unwrap_or(f64::INFINITY)
}

/// Error of an edge and its derivatives with respect to (x, y, yaw) of both ends.
fn linearize(edge: &Edge, pose_a: &Pose2, pose_b: &Pose2) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
    let predicted = error_vector(&(pose_a.inverse() * pose_b));
    let mut error = predicted - error_vector(&edge.transform_a_b.pose);
    error.z = wrap_angle(error.z);
    let [by_a, by_b] = relative_pose::derivatives(pose_a, pose_b);
    (error, by_a, by_b)
}

/// The poses with their covariances: of the inverse of the normal equations `L L^T` only the blocks on the diagonal
/// are needed, which are the products of three columns of `L^-1` with each other. `None` if `L` has no inverse.
fn assemble(
    estimate: &[Option<Pose2>],
    unknown: &[Option<usize>],
    lower: &DMatrix<f64>,
) -> Option<Vec<Option<UncertainPose>>> {
    let mut poses = Vec::with_capacity(estimate.len());
    for (pose, place) in estimate.iter().zip(unknown) {
        let covariance = match *place {
            Some(place) => {
                // The columns are zero above `place`.
                let count = lower.nrows() - place;
                let mut columns = OMatrix::<f64, Dyn, U3>::identity(count);
                if !lower.view((place, place), (count, count)).solve_lower_triangular_mut(&mut columns) {
                    return None;
                }
                columns.tr_mul(&columns)
            }
            None => Matrix3::zeros(),
        };
        poses.push(pose.map(|pose| UncertainPose { pose, covariance }));
    }
    Some(poses)
}

#[cfg(test)]
mod tests {
    use super::super::graph::Forest;
    use super::*;

    fn edge(a: usize, b: usize, transform_a_b: Pose2, variance: f64) -> Edge {
        Edge { a, b, transform_a_b: UncertainPose { pose: transform_a_b, covariance: Matrix3::identity() * variance } }
    }

    fn solve(robots: usize, edges: &[Edge]) -> Vec<UncertainPose> {
        let start = Forest::grow(robots, edges, 0, |_| true).poses(edges, 0);
        optimize(&start, edges, 0).unwrap().into_iter().flatten().collect()
    }

    #[test]
    fn the_covariance_along_a_chain_is_that_of_the_composed_transforms() {
        let edges = [edge(0, 1, pose(3.0, 1.0, 0.7), 1e-4), edge(2, 1, pose(-2.0, 5.0, -2.0), 1e-4)];
        let composed = edges[0].transform_a_b.then(&edges[1].transform_a_b.inverse());
        let solved = solve(3, &edges);
        assert!((solved[2].covariance - composed.covariance).norm() < 1e-9);
    }

    #[test]
    fn the_error_of_a_cycle_is_shared_by_weight() {
        let edges = [
            edge(0, 1, pose(1.0, 0.0, 0.0), 1.0),
            edge(1, 2, pose(1.0, 0.0, 0.0), 1.0),
            edge(0, 2, pose(2.3, 0.0, 0.0), 1.0),
        ];
        let solved = solve(3, &edges);
        assert!((solved[1].pose.translation.x - 1.1).abs() < 1e-9);
        assert!((solved[2].pose.translation.x - 2.2).abs() < 1e-9);
        assert!((solved[2].covariance[(0, 0)] - 2.0 / 3.0).abs() < 1e-9, "two paths reduce the variance");
    }

    #[test]
    fn a_cycle_is_solved_across_the_wrap_of_angles() {
        let edges = [
            edge(0, 1, pose(4.0, 1.0, 3.1), 0.01),
            edge(1, 2, pose(-1.0, 2.0, 3.12), 0.01),
            edge(0, 2, pose(4.0, 1.0, 3.1) * pose(-1.0, 2.0, 3.12), 0.01),
        ];
        for (solved, start) in solve(3, &edges).iter().zip(Forest::grow(3, &edges, 0, |_| true).poses(&edges, 0)) {
            assert!(error_vector(&(solved.pose.inverse() * start.unwrap().pose)).norm() < 1e-9);
        }
    }

    #[test]
    fn an_invalid_covariance_has_no_solution() {
        let edges = [edge(0, 1, pose(1.0, 0.0, 0.0), -1.0)];
        let start = vec![Some(UncertainPose::identity()); 2];
        assert!(optimize(&start, &edges, 0).is_none());
    }
}

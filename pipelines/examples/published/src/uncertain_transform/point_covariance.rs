//! Covariance of a transformed point.

use gridweave_stages::shared::geometry::{Point2, Pose2, point_jacobian};
use nalgebra::{Matrix2, Matrix3, SymmetricEigen};

/// Covariance of transformed points, by their position: `S_n = J S_tr J^T`.
#[derive(Clone, Copy, Debug)]
pub struct PointCovariance {
    /// Covariance of the transform, (x, y, yaw), metres and radians.
    covariance: Matrix3<f64>,
    transform: Pose2,
    /// Variance that is added along each axis, square metres.
    cell_variance: f64,
    /// Largest variance in any direction, square metres.
    most: f64,
}

impl PointCovariance {
    /// Covariance of points after a transform with a covariance, into cells of `resolution` metres. No standard
    /// deviation is above `max_deviation` metres. `None` if the covariance is invalid: a value is not finite, or a
    /// variance is below 0.
    pub fn new(transform: &Pose2, covariance: &Matrix3<f64>, resolution: f64, max_deviation: f64) -> Option<Self> {
        let is_finite = covariance.iter().chain(transform.translation.vector.iter()).all(|value| value.is_finite());
        if !(is_finite && transform.rotation.angle().is_finite()) {
            return None;
        }
        let symmetric = (covariance + covariance.transpose()) / 2.0;
        // Rounding makes the least variance of a covariance slightly smaller.
        let least = -1e-9 * (1.0 + symmetric.norm());
        if SymmetricEigen::new(symmetric).eigenvalues.iter().any(|variance| *variance < least) {
            return None;
        }
        let cell_variance = resolution.powi(2) / 12.0;
        Some(Self { covariance: symmetric, transform: *transform, cell_variance, most: max_deviation.powi(2) })
    }

    /// Covariance of a point transformed to `n`, square metres.
    pub fn at(&self, n: &Point2) -> Matrix2<f64> {
        let jacobian = point_jacobian(&self.transform, &self.transform.inverse_transform_point(n));
        let covariance = jacobian * self.covariance * jacobian.transpose();
        let greatest = greatest_variance(&covariance);
        let share = if greatest > self.most { self.most / greatest } else { 1.0 };
        covariance * share + Matrix2::from_diagonal_element(self.cell_variance)
    }

    /// Largest standard deviation of all points in the convex hull of some, metres: it is reached at one of them, as
    /// the variance in any direction is a convex function of the position.
    pub fn greatest_deviation(&self, corners: &[Point2]) -> f64 {
        corners.iter().map(|corner| greatest_variance(&self.at(corner))).fold(0.0, f64::max).sqrt()
    }
}

/// The greater eigenvalue of a symmetric matrix.
fn greatest_variance(covariance: &Matrix2<f64>) -> f64 {
    let (mean, half) = (0.5 * covariance.trace(), 0.5 * (covariance[(0, 0)] - covariance[(1, 1)]));
    mean + half.hypot(covariance[(0, 1)])
}

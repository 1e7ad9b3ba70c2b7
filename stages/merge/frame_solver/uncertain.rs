//! Rigid transforms with a covariance.

use crate::shared::geometry::{Pose2, quarter_turn, wrap_angle};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// A rigid transform and the covariance of its (x, y, yaw), metres and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UncertainPose {
    /// The transform.
    pub pose: Pose2,
    /// Covariance of (x, y, yaw): errors add to the translation in the outer frame, and to the angle.
    pub covariance: Matrix3<f64>,
}

impl UncertainPose {
    /// The identity, known exactly.
    pub fn identity() -> Self {
        Self { pose: Pose2::identity(), covariance: Matrix3::zeros() }
    }

    /// `T_b_a` of `T_a_b`, its covariance to first order.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let back = self.pose.rotation.inverse();
        // The turn moves the origin by the derivative of -R(-yaw) t.
        let lever = back * quarter_turn(&self.pose.translation.vector);
        let jacobian = jacobian(&-back.to_rotation_matrix().into_inner(), &lever, -1.0);
        Self { pose: self.pose.inverse(), covariance: jacobian * self.covariance * jacobian.transpose() }
    }

    /// `T_a_c` from this `T_a_b` and `T_b_c`, whose errors are assumed independent; covariance to first order.
    #[must_use]
    pub fn then(&self, transform_b_c: &Self) -> Self {
        let lever = quarter_turn(&(self.pose.rotation * transform_b_c.pose.translation.vector));
        let by_self = jacobian(&Matrix2::identity(), &lever, 1.0);
        let turn = self.pose.rotation.to_rotation_matrix().into_inner();
        let by_next = jacobian(&turn, &Vector2::zeros(), 1.0);
        Self {
            pose: self.pose * transform_b_c.pose,
            covariance: by_self * self.covariance * by_self.transpose()
                + by_next * transform_b_c.covariance * by_next.transpose(),
        }
    }

    /// The same transform with the variances `position_deviation`^2 (metres, along x and y) and `yaw_deviation`^2
    /// (radians) added.
    ///
    /// The added turn is about the point that the covariance itself turns about, where the maps were aligned, and not
    /// about the map's origin, which may be far away.
    #[must_use]
    pub fn with_floor(&self, position_deviation: f64, yaw_deviation: f64) -> Self {
        let covariance = &self.covariance;
        let yaw_variance = covariance[(2, 2)];
        let lever = match yaw_variance > 0.0 {
            true => Vector3::new(covariance[(0, 2)] / yaw_variance, covariance[(1, 2)] / yaw_variance, 1.0),
            false => Vector3::new(0.0, 0.0, 1.0),
        };
        let position = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * position_deviation.powi(2);
        let turn = lever * lever.transpose() * yaw_deviation.powi(2);
        Self { pose: self.pose, covariance: covariance + position + turn }
    }

    /// Mahalanobis distance of the transform from the identity. Infinite if the covariance has no inverse.
    pub fn distance_from_identity(&self) -> f64 {
        let error = error_vector(&self.pose);
        let squared = self.covariance.cholesky().map(|cholesky| error.dot(&cholesky.solve(&error)));
        squared.filter(|squared| squared.is_finite()).map_or(f64::INFINITY, f64::sqrt)
    }

    /// Scalar uncertainty that adds up along a path: the variance of a point ten metres away, square metres.
    pub fn spread(&self) -> f64 {
        const LEVER: f64 = 10.0;
        self.covariance[(0, 0)] + self.covariance[(1, 1)] + LEVER * LEVER * self.covariance[(2, 2)]
    }
}

/// (x, y, yaw) of a transform, the yaw in `(-pi, pi]`.
pub fn error_vector(pose: &Pose2) -> Vector3<f64> {
    Vector3::new(pose.translation.x, pose.translation.y, wrap_angle(pose.rotation.angle()))
}

fn jacobian(turn: &Matrix2<f64>, lever: &Vector2<f64>, yaw: f64) -> Matrix3<f64> {
    Matrix3::new(turn[(0, 0)], turn[(0, 1)], lever.x, turn[(1, 0)], turn[(1, 1)], lever.y, 0.0, 0.0, yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use proptest::prelude::*;

    prop_compose! {
        fn uncertain()(x in -9.0..9.0, y in -9.0..9.0, yaw in -3.0..3.0, parts in prop::array::uniform9(-0.2..0.2))
            -> UncertainPose {
            let root = Matrix3::from_row_slice(&parts);
            UncertainPose { pose: pose(x, y, yaw), covariance: root * root.transpose() + Matrix3::identity() * 1e-4 }
        }
    }

    /// Jacobian of `f(pose)` with respect to x, y and yaw, by differences.
    fn differences(at: &Pose2, f: impl Fn(&Pose2) -> Pose2) -> Matrix3<f64> {
        const STEP: f64 = 1e-6;
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let moved = |by: f64| {
                let v = axis * by;
                f(&pose(at.translation.x + v.x, at.translation.y + v.y, at.rotation.angle() + v.z))
            };
            let (low, high) = (moved(-STEP), moved(STEP));
            let yaw = wrap_angle(high.rotation.angle() - low.rotation.angle());
            let shift = high.translation.vector - low.translation.vector;
            Vector3::new(shift.x, shift.y, yaw) / (2.0 * STEP)
        });
        Matrix3::from_columns(&columns)
    }

    proptest! {
        #[test]
        fn covariances_follow_the_derivative_of_the_transform(a in uncertain(), b in uncertain()) {
            let j = differences(&a.pose, Pose2::inverse);
            prop_assert!((a.inverse().covariance - j * a.covariance * j.transpose()).norm() < 1e-5);
            let (ja, jb) = (differences(&a.pose, |p| p * b.pose), differences(&b.pose, |p| a.pose * p));
            let expected = ja * a.covariance * ja.transpose() + jb * b.covariance * jb.transpose();
            prop_assert!((a.then(&b).covariance - expected).norm() < 1e-5);
        }

        #[test]
        fn the_inverse_of_the_inverse_is_the_transform(a in uncertain()) {
            let twice = a.inverse().inverse();
            prop_assert!((twice.covariance - a.covariance).norm() < 1e-9);
            prop_assert!(error_vector(&(twice.pose.inverse() * a.pose)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_transform_without_covariance_is_infinitely_far_from_the_identity() {
        assert_eq!(UncertainPose::identity().distance_from_identity(), f64::INFINITY);
    }

    #[test]
    fn the_floor_turns_about_the_point_that_the_covariance_turns_about() {
        // Known to 0.01 m at the point (20, 0) of the outer frame, and to 0.001 rad.
        let lever = Vector3::new(0.0, -20.0, 1.0);
        let covariance = lever * lever.transpose() * 1e-6 + Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 0.0));
        let floored = UncertainPose { pose: Pose2::identity(), covariance }.with_floor(0.05, 0.01).covariance;
        let at_point = Vector3::new(0.0, 1.0, 20.0);
        let variance = at_point.dot(&(floored * at_point));
        assert!((variance - (0.01f64.powi(2) + 0.05f64.powi(2))).abs() < 1e-9, "{variance}");
    }
}

//! The initial guess of ICP, and its covariance.

use super::IcpParameters;
use crate::shared::geometry::{Point2, Pose2, wrap_angle};
use nalgebra::{Matrix3, Vector3};

/// An initial guess of `T_a_b` with the covariance of its x, y and yaw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialGuess {
    /// Pose of map b in map a.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
}

impl InitialGuess {
    /// Makes an initial guess. A covariance that is not finite or not positive definite is replaced by the default of
    /// the parameters.
    pub fn new(transform_a_b: Pose2, covariance: Matrix3<f64>, parameters: &IcpParameters) -> Self {
        let symmetric = (covariance + covariance.transpose()) / 2.0;
        let usable = symmetric.iter().all(|value| value.is_finite()) && symmetric.cholesky().is_some();
        let covariance = if usable {
            symmetric
        } else {
            let position = parameters.initial_position_deviation.powi(2);
            Matrix3::from_diagonal(&Vector3::new(position, position, parameters.initial_yaw_deviation.powi(2)))
        };
        Self { transform_a_b, covariance }
    }
}

/// Coordinates for small changes of a transform: a shift, and a turn about a point in frame a.
///
/// Far from the frame's origin a turn moves everything, so x, y and yaw of the transform are correlated. In these
/// coordinates they hardly are: (shift x, shift y, turn x `scale`), all metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalFrame {
    pub(super) centre: Point2,
    /// Metres per radian: the root mean square distance of the wall points from the centre.
    pub(super) scale: f64,
}

impl LocalFrame {
    /// Derivative of (x, y, yaw) of `transform` with respect to the local coordinates.
    pub(super) fn jacobian(&self, transform: &Pose2) -> Matrix3<f64> {
        let arm = transform.translation.vector - self.centre.coords;
        let turn = 1.0 / self.scale;
        Matrix3::new(1.0, 0.0, -arm.y * turn, 0.0, 1.0, arm.x * turn, 0.0, 0.0, turn)
    }

    /// Derivative of the local coordinates with respect to (x, y, yaw) of `transform`.
    pub(super) fn inverse_jacobian(&self, transform: &Pose2) -> Matrix3<f64> {
        let arm = transform.translation.vector - self.centre.coords;
        Matrix3::new(1.0, 0.0, arm.y, 0.0, 1.0, -arm.x, 0.0, 0.0, self.scale)
    }

    /// The transform after a small change in local coordinates.
    pub(super) fn moved(&self, transform: &Pose2, change: &Vector3<f64>) -> Pose2 {
        let turn = nalgebra::UnitComplex::new(change.z / self.scale);
        let offset = turn * (transform.translation.vector - self.centre.coords);
        let translation = self.centre.coords + offset + change.xy();
        Pose2::from_parts(translation.into(), turn * transform.rotation)
    }
}

impl InitialGuess {
    /// Covariance of the initial guess in local coordinates, with the slack of the parameters added.
    pub(super) fn local_covariance(&self, frame: &LocalFrame, parameters: &IcpParameters) -> Matrix3<f64> {
        let derivative = frame.inverse_jacobian(&self.transform_a_b);
        let position = parameters.position_slack.powi(2);
        let slack = Vector3::new(position, position, (parameters.yaw_slack * frame.scale).powi(2));
        derivative * self.covariance * derivative.transpose() + Matrix3::from_diagonal(&slack)
    }

    /// Deviation of a transform from the initial guess, in local coordinates.
    pub(super) fn local_deviation(&self, transform: &Pose2, frame: &LocalFrame) -> Vector3<f64> {
        // Exact for any turn: the change is applied to the centre.
        let change = transform * self.transform_a_b.inverse();
        let shift = change * frame.centre - frame.centre;
        let turn = wrap_angle(change.rotation.angle());
        Vector3::new(shift.x, shift.y, turn * frame.scale)
    }

    /// Mahalanobis distance of a transform from the initial guess, slack included.
    pub(super) fn distance(&self, transform: &Pose2, frame: &LocalFrame, parameters: &IcpParameters) -> f64 {
        let deviation = self.local_deviation(transform, frame);
        match self.local_covariance(frame, parameters).try_inverse() {
            Some(inverse) => deviation.dot(&(inverse * deviation)).max(0.0).sqrt(),
            None => f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_jacobian_is_the_derivative_of_a_small_change(
            x in -50.0..50.0, y in -50.0..50.0, yaw in -3.0..3.0,
            centre_x in -50.0..50.0, centre_y in -50.0..50.0, scale in 0.5..20.0,
            change in prop::array::uniform3(-1e-6..1e-6),
        ) {
            let frame = LocalFrame { centre: Point2::new(centre_x, centre_y), scale };
            let transform = pose(x, y, yaw);
            let change = Vector3::from(change);
            let moved = frame.moved(&transform, &change);
            let shift = moved.translation.vector - transform.translation.vector;
            let turn = wrap_angle(moved.rotation.angle() - yaw);
            prop_assert!((frame.jacobian(&transform) * change - shift.push(turn)).norm() < 1e-9);
            let identity = frame.jacobian(&transform) * frame.inverse_jacobian(&transform);
            prop_assert!((identity - Matrix3::identity()).norm() < 1e-9);
        }

        #[test]
        fn the_deviation_from_the_first_guess_is_the_change_made(
            x in -50.0..50.0, y in -50.0..50.0, yaw in -3.0..3.0, change in prop::array::uniform3(-0.5..0.5),
        ) {
            let frame = LocalFrame { centre: Point2::new(7.0, -30.0), scale: 4.0 };
            let guess = InitialGuess { transform_a_b: pose(x, y, yaw), covariance: Matrix3::identity() };
            let change = Vector3::from(change);
            let moved = frame.moved(&guess.transform_a_b, &change);
            prop_assert!((guess.local_deviation(&moved, &frame) - change).norm() < 1e-9);
        }
    }

    #[test]
    fn an_invalid_covariance_is_replaced() {
        let parameters = IcpParameters::default();
        let usable = Matrix3::identity() * 0.01;
        let kept = InitialGuess::new(pose(0.0, 0.0, 0.0), usable, &parameters);
        assert_eq!(kept.covariance, usable);
        for covariance in [Matrix3::zeros(), -usable, usable * f64::NAN, usable * f64::INFINITY] {
            let guess = InitialGuess::new(pose(0.0, 0.0, 0.0), covariance, &parameters);
            assert_eq!(guess.covariance.m11, parameters.initial_position_deviation.powi(2));
            assert_eq!(guess.covariance.m33, parameters.initial_yaw_deviation.powi(2));
        }
    }
}

//! A measurement of one pose in the frame of another, as a factor of a graph of poses.

use super::{Pose2, quarter_turn, wrap_angle};
use nalgebra::{Matrix3, UnitComplex, Vector3};

/// Residual (x, y, yaw) of a measured `T_from_to` at two poses, in the frame of `from`.
pub fn residual(from: &Pose2, to: &Pose2, measured: &Pose2) -> Vector3<f64> {
    let found = from.inv_mul(to);
    let off = found.translation.vector - measured.translation.vector;
    Vector3::new(off.x, off.y, wrap_angle(found.rotation.angle() - measured.rotation.angle()))
}

/// Derivatives of the residual by both poses: (x, y) in the frame in which these are, and yaw.
pub fn derivatives(from: &Pose2, to: &Pose2) -> [Matrix3<f64>; 2] {
    let by_to = rotation_of_pose(&from.rotation.inverse());
    let arm = from.inv_mul(to).translation.vector;
    let mut by_from = -by_to;
    by_from.fixed_view_mut::<2, 1>(0, 2).copy_from(&-quarter_turn(&arm));
    [by_from, by_to]
}

/// The matrix that turns (x, y, yaw).
pub fn rotation_of_pose(rotation: &UnitComplex<f64>) -> Matrix3<f64> {
    let (sine, cosine) = (rotation.im, rotation.re);
    Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn derivatives_are_those_of_the_residual() {
        let (from, to, measured) = (pose(1.0, -2.0, 0.7), pose(3.0, 0.5, -1.1), pose(0.4, 0.3, -1.9));
        let moved = |of: &Pose2, step: Vector3<f64>| {
            pose(of.translation.x + step.x, of.translation.y + step.y, of.rotation.angle() + step.z)
        };
        let [by_from, by_to] = derivatives(&from, &to);
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 1e-6;
            let by_first =
                residual(&moved(&from, step), &to, &measured) - residual(&moved(&from, -step), &to, &measured);
            let by_second =
                residual(&from, &moved(&to, step), &measured) - residual(&from, &moved(&to, -step), &measured);
            assert!((by_first / 2e-6 - by_from.column(axis)).norm() < 1e-6);
            assert!((by_second / 2e-6 - by_to.column(axis)).norm() < 1e-6);
        }
    }
}

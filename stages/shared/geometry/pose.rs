//! Poses in the plane.

use nalgebra::{Isometry2, Matrix3, Vector2};
use std::f64::consts::{PI, TAU};

/// A pose in the plane, or the rigid transform from its frame: metres and radians.
pub type Pose2 = Isometry2<f64>;

/// A point in the plane, metres.
pub type Point2 = nalgebra::Point2<f64>;

/// The pose at (x, y) metres, turned by `yaw` radians.
pub fn pose(x: f64, y: f64, yaw: f64) -> Pose2 {
    Isometry2::new(Vector2::new(x, y), yaw)
}

/// A vector turned left by a quarter turn: the motion of a point under a small turn about the origin.
pub fn quarter_turn(vector: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-vector.y, vector.x)
}

/// A covariance of (x, y, yaw) as a row-major array, as in messages.
pub fn row_by_row(covariance: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|index| covariance[(index / 3, index % 3)])
}

/// The same angle in `(-pi, pi]`.
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = (angle + PI).rem_euclid(TAU) - PI;
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

/// `a - b` for directions that repeat every `period` radians, in `(-period / 2, period / 2]`.
pub fn turn_difference(a: f64, b: f64, period: f64) -> f64 {
    let difference = (a - b).rem_euclid(period);
    if difference > period / 2.0 { difference - period } else { difference }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction(angle in -50.0..50.0) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((wrapped.sin() - f64::sin(angle)).abs() < 1e-9);
            prop_assert!((wrapped.cos() - f64::cos(angle)).abs() < 1e-9);
        }

        #[test]
        fn a_difference_of_directions_is_within_half_a_period(a in -9.0..9.0, b in -9.0..9.0) {
            let difference = turn_difference(a, b, FRAC_PI_2);
            prop_assert!(difference.abs() <= FRAC_PI_2 / 2.0 + 1e-12);
            let turns = (a - b - difference) / FRAC_PI_2;
            prop_assert!((turns - turns.round()).abs() < 1e-9);
        }
    }
}

//! Covariance of a robot's position.

use nalgebra::Matrix2;
use std::f64::consts::PI;

/// Largest rounding error of a valid covariance, relative to its variances.
const ROUNDING: f64 = 1e-6;

/// Why a covariance is not used as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CovarianceProblem {
    /// It is invalid: not finite, with a negative variance, or with a correlation above 1.
    Impossible,
    /// The position is more uncertain than the reach of a tag.
    Huge,
}

/// Covariance of a position in the plane, from the rows of x and y in that of a pose over (x, y, z, roll, pitch, yaw)
/// as in messages; square metres, zeros if it is unknown.
///
/// An invalid one counts as unknown. Deviations greater than `reach` metres are clamped to `reach`: such a pose
/// locates no tag. The second value is the problem, if any.
pub fn position_covariance(rows: &[[f64; 6]; 2], reach: f64) -> (Matrix2<f64>, Option<CovarianceProblem>) {
    let [[xx, xy, ..], [yx, yy, ..]] = *rows;
    let both = 0.5 * (xy + yx);
    let position = Matrix2::new(xx, both, both, yy);
    let slack = ROUNDING * (xx.abs() + yy.abs());
    let is_possible = position.iter().all(|value| value.is_finite())
        && (xy - yx).abs() <= slack
        && xx >= 0.0
        && yy >= 0.0
        && both * both <= xx * yy + slack * slack;
    if !is_possible {
        return (Matrix2::zeros(), Some(CovarianceProblem::Impossible));
    }
    let most = reach * reach;
    match largest_variance(&position) > most {
        true => (Matrix2::from_diagonal_element(most), Some(CovarianceProblem::Huge)),
        false => (position, None),
    }
}

/// Variance of a heading, square radians; 0 if it is unknown or invalid. It is clamped to that of a uniform heading.
pub fn heading_variance(variance: f64) -> f64 {
    if variance.is_finite() && variance > 0.0 { variance.min(PI * PI / 3.0) } else { 0.0 }
}

/// Variance along the direction in which it is largest: the larger eigenvalue.
pub fn largest_variance(covariance: &Matrix2<f64>) -> f64 {
    let mean = 0.5 * (covariance.m11 + covariance.m22);
    mean + (0.5 * (covariance.m11 - covariance.m22)).hypot(0.5 * (covariance.m12 + covariance.m21))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const REACH: f64 = 3.0;

    /// Two rows with a given part over x and y, and a large rest.
    fn covariance(xx: f64, xy: f64, yx: f64, yy: f64) -> [[f64; 6]; 2] {
        let mut rows = [[77.0; 6]; 2];
        (rows[0][0], rows[0][1], rows[1][0], rows[1][1]) = (xx, xy, yx, yy);
        rows
    }

    #[test]
    fn only_the_position_counts() {
        let (position, problem) = position_covariance(&covariance(0.04, -0.01, -0.01, 0.09), REACH);
        assert_eq!((position, problem), (Matrix2::new(0.04, -0.01, -0.01, 0.09), None));
        assert_eq!(position_covariance(&[[0.0; 6]; 2], REACH), (Matrix2::zeros(), None));
    }

    #[test]
    fn an_invalid_covariance_counts_as_unknown() {
        for [xx, xy, yx, yy] in [
            [f64::NAN, 0.0, 0.0, 1.0],
            [1.0, f64::NAN, 0.0, 1.0],
            [1.0, 0.0, 0.0, f64::INFINITY],
            [-1.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, -1e-9],
            [1.0, 1.1, 1.1, 1.0],
            [1.0, 0.3, -0.3, 1.0],
            [f64::MAX, f64::MAX, f64::MAX, f64::MAX],
        ] {
            let found = position_covariance(&covariance(xx, xy, yx, yy), REACH);
            assert_eq!(found, (Matrix2::zeros(), Some(CovarianceProblem::Impossible)), "{xx} {xy} {yx} {yy}");
        }
    }

    #[test]
    fn a_huge_covariance_is_clamped_to_the_reach() {
        for huge in [9.1, 1e6, 1e300] {
            let found = position_covariance(&covariance(0.01, 0.0, 0.0, huge), REACH);
            assert_eq!(found, (Matrix2::from_diagonal_element(9.0), Some(CovarianceProblem::Huge)), "{huge}");
        }
        assert_eq!(position_covariance(&covariance(0.01, 0.0, 0.0, 8.9), REACH).1, None);
    }

    #[test]
    fn an_invalid_variance_of_a_heading_counts_as_unknown() {
        for none in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert_eq!(heading_variance(none), 0.0);
        }
        assert_eq!((heading_variance(0.01), heading_variance(1e9)), (0.01, PI * PI / 3.0));
    }

    proptest! {
        #[test]
        fn no_direction_has_more_than_the_largest_variance(a in -1.0..1.0, b in -1.0..1.0, c in -1.0..1.0, turn in 0.0..7.0) {
            let root = Matrix2::new(a, b, 0.0, c);
            let covariance = root * root.transpose();
            let along = nalgebra::Vector2::new(f64::cos(turn), f64::sin(turn));
            let largest = largest_variance(&covariance);
            prop_assert!(along.dot(&(covariance * along)) <= largest + 1e-12);
            let eigenvalues = covariance.symmetric_eigenvalues();
            prop_assert!((largest - eigenvalues.max()).abs() < 1e-9);
        }
    }
}

//! The error ellipse of a 2 x 2 covariance.

use nalgebra::Matrix2;

/// An ellipse of equal probability about a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceEllipse {
    /// The longer half axis and the shorter one, in the unit of the position.
    pub half_axes: [f64; 2],
    /// The direction of the longer one, radians, from -pi/2 to pi/2; 0 if both are as long.
    pub direction: f64,
}

impl CovarianceEllipse {
    /// The ellipse of a number of standard deviations. `None` if the covariance is not finite, or so large that the
    /// ellipse is not.
    ///
    /// Closed form, so it never fails to converge.
    pub fn new(covariance: &Matrix2<f64>, deviations: f64) -> Option<Self> {
        let (sum, difference) = (covariance.m11 + covariance.m22, covariance.m11 - covariance.m22);
        let mixed = covariance.m12 + covariance.m21;
        let spread = difference.hypot(mixed);
        let half_axis = |doubled: f64| deviations * (0.5 * doubled).max(0.0).sqrt();
        let half_axes = [half_axis(sum + spread), half_axis(sum - spread)];
        let direction = 0.5 * mixed.atan2(difference);
        let is_finite = half_axes.iter().chain([&spread, &direction]).all(|value| value.is_finite());
        is_finite.then_some(Self { half_axes, direction })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation2;

    #[test]
    fn an_ellipse_has_the_axes_that_its_covariance_was_turned_from() {
        for direction in [-1.5, -0.4, 0.0, 0.3, 1.5] {
            let turn = Rotation2::new(direction).into_inner();
            let covariance = turn * Matrix2::new(9.0, 0.0, 0.0, 4.0) * turn.transpose();
            let ellipse = CovarianceEllipse::new(&covariance, 2.0).unwrap();
            assert!((ellipse.half_axes[0] - 6.0).abs() < 1e-9 && (ellipse.half_axes[1] - 4.0).abs() < 1e-9);
            assert!((ellipse.direction - direction).abs() < 1e-9, "{ellipse:?}");
        }
        let round = CovarianceEllipse::new(&Matrix2::identity(), 1.0).unwrap();
        assert_eq!(round, CovarianceEllipse { half_axes: [1.0; 2], direction: 0.0 });
    }

    #[test]
    fn an_invalid_covariance_has_no_ellipse_or_a_flat_one() {
        for odd in [f64::NAN, f64::INFINITY, 1e308] {
            assert_eq!(CovarianceEllipse::new(&Matrix2::new(odd, 0.0, 0.0, odd), 1.0), None, "{odd}");
        }
        assert_eq!(CovarianceEllipse::new(&-Matrix2::identity(), 1.0).unwrap().half_axes, [0.0; 2]);
    }
}

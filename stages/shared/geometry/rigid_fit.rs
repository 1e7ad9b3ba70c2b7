//! The rigid transform between two sets of points whose correspondence is known.
//!
//! Least squares in closed form: Kabsch 1976 and Umeyama 1991, in the plane and without scale.

use super::{Point2, Pose2, quarter_turn, wrap_angle};
use nalgebra::{Isometry2, Matrix2, Matrix2x3, Matrix3, Vector2};

/// The same point in two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// The point in frame a, metres.
    pub a: Point2,
    /// The point in frame b, metres.
    pub b: Point2,
    /// Weight of the pair: the inverse of the variance of `a - T_a_b * b` along one axis, 1 / square metres. Where
    /// variances are not known, any positive number; the covariance of the fit is then meaningless.
    pub weight: f64,
}

/// A rigid transform fitted to pairs of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidFit {
    /// `T_a_b`: transforms a point in frame b to frame a.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw) of `T_a_b`, metres and radians, if the weights are inverse variances.
    pub covariance: Matrix3<f64>,
    /// Weighted root mean square of the residuals, metres.
    pub rms: f64,
}

impl RigidFit {
    /// Covariance of `T_a_b * b` from the transform only, square metres.
    pub fn point_covariance(&self, b: &Point2) -> Matrix2<f64> {
        let jacobian = point_jacobian(&self.transform_a_b, b);
        jacobian * self.covariance * jacobian.transpose()
    }

    /// Standard deviation of the rotation, radians.
    pub fn yaw_stddev(&self) -> f64 {
        self.covariance[(2, 2)].max(0.0).sqrt()
    }
}

/// Derivative of `T_a_b * b` with respect to (x, y, yaw).
pub fn point_jacobian(transform_a_b: &Pose2, b: &Point2) -> Matrix2x3<f64> {
    let turned = transform_a_b.rotation * b.coords;
    Matrix2x3::new(1.0, 0.0, -turned.y, 0.0, 1.0, turned.x)
}

/// Covariance of (x, y, yaw) of a `T_a_b` that transforms a point of b to a point of a with a covariance, square
/// metres, and turns about it with an independent variance, square radians.
pub fn covariance_about(transform_a_b: &Pose2, b: &Point2, of_place: &Matrix2<f64>, yaw_variance: f64) -> Matrix3<f64> {
    // t = a - R b, so a turn moves t opposite to the point.
    let arm = -quarter_turn(&(transform_a_b.rotation * b.coords));
    let mut covariance = Matrix3::zeros();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&(of_place + arm * arm.transpose() * yaw_variance));
    covariance.fixed_view_mut::<2, 1>(0, 2).copy_from(&(arm * yaw_variance));
    covariance.fixed_view_mut::<1, 2>(2, 0).copy_from(&(arm.transpose() * yaw_variance));
    covariance[(2, 2)] = yaw_variance;
    covariance
}

/// Minimizes the weighted sum of the squared distances between `a` and `T_a_b * b`.
///
/// Pairs with a value that is not finite, or with a weight that is not positive, are ignored. The result is never a
/// reflection. `None` if the rotation is not determined: fewer than two pairs, or all points of a set at one
/// position.
pub fn fit_rigid(pairs: &[PointPair]) -> Option<RigidFit> {
    let usable = || pairs.iter().filter(|pair| is_usable(pair));
    let count = usable().count();
    let weight: f64 = usable().map(|pair| pair.weight).sum();
    if count < 2 || !weight.is_finite() {
        return None;
    }
    let centre = |point: fn(&PointPair) -> Point2| {
        Point2::from(usable().fold(Vector2::zeros(), |sum, pair| sum + point(pair).coords * (pair.weight / weight)))
    };
    let (centre_a, centre_b) = (centre(|pair| pair.a), centre(|pair| pair.b));

    // In the plane the rotation of the singular value decomposition is one angle: that of the sum of a * conj(b).
    let (mut cosine, mut sine, mut spread_a, mut spread_b) = (0.0, 0.0, 0.0, 0.0);
    for pair in usable() {
        let (a, b) = (pair.a - centre_a, pair.b - centre_b);
        let share = pair.weight / weight;
        cosine += share * a.dot(&b);
        sine += share * (b.x * a.y - b.y * a.x);
        spread_a += share * a.norm_squared();
        spread_b += share * b.norm_squared();
    }
    let strength = cosine.hypot(sine);
    // Rounding of coordinates far from the origin must not count as a spread.
    let size = centre_a.coords.norm_squared().max(centre_b.coords.norm_squared());
    let least = 1e-24 + 1e-26 * size;
    if !(spread_a > least && spread_b > least && strength > 1e-9 * (spread_a * spread_b).sqrt()) {
        return None;
    }
    let rotation = nalgebra::UnitComplex::from_cos_sin_unchecked(cosine / strength, sine / strength);
    let translation = centre_a.coords - rotation * centre_b.coords;
    let transform_a_b = Isometry2::new(translation, wrap_angle(rotation.angle()));

    // About the centroid, translation and rotation are independent; moving to the origin of b correlates them.
    let yaw_variance = 1.0 / (weight * spread_b);
    let about_centre = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0 / weight, 1.0 / weight, yaw_variance));
    let arm = rotation * centre_b.coords;
    let to_origin = Matrix3::new(1.0, 0.0, arm.y, 0.0, 1.0, -arm.x, 0.0, 0.0, 1.0);
    let covariance = to_origin * about_centre * to_origin.transpose();

    let squares: f64 = usable().map(|pair| pair.weight * (pair.a - transform_a_b * pair.b).norm_squared()).sum();
    let fit = RigidFit { transform_a_b, covariance, rms: (squares / weight).sqrt() };
    let finite = translation.iter().chain(covariance.iter()).all(|value| value.is_finite());
    finite.then_some(fit)
}

fn is_usable(pair: &PointPair) -> bool {
    let finite = pair.a.iter().chain(pair.b.iter()).all(|value| value.is_finite());
    finite && pair.weight.is_finite() && pair.weight > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{pose, turn_difference};
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    fn pairs(transform_a_b: &Pose2, points: &[(f64, f64, f64)]) -> Vec<PointPair> {
        let pair = |&(x, y, weight): &(f64, f64, f64)| {
            let b = Point2::new(x, y);
            PointPair { a: transform_a_b * b, b, weight }
        };
        points.iter().map(pair).collect()
    }

    fn points() -> impl Strategy<Value = Vec<(f64, f64, f64)>> {
        let far_apart =
            |points: &Vec<(f64, f64, f64)>| points.iter().any(|p| (p.0 - points[0].0).hypot(p.1 - points[0].1) > 0.5);
        prop::collection::vec((-50.0..50.0, -50.0..50.0, 0.1..10.0), 2..20).prop_filter("in one place", far_apart)
    }

    proptest! {
        #[test]
        fn the_transform_of_exact_pairs_is_recovered(
            x in -90.0..90.0, y in -90.0..90.0, yaw in -4.0..4.0, points in points(),
        ) {
            let truth = pose(x, y, yaw);
            let fit = fit_rigid(&pairs(&truth, &points)).unwrap();
            prop_assert!((fit.transform_a_b.translation.vector - truth.translation.vector).norm() < 1e-6);
            prop_assert!(turn_difference(fit.transform_a_b.rotation.angle(), yaw, TAU).abs() < 1e-8);
            prop_assert!(fit.rms < 1e-7);
        }

        #[test]
        fn exchanging_the_frames_gives_the_inverse(
            x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0, points in points(), noise in -0.2..0.2,
        ) {
            let mut forth = pairs(&pose(x, y, yaw), &points);
            for (index, pair) in forth.iter_mut().enumerate() {
                pair.a.x += noise * (index % 3) as f64;
            }
            let back: Vec<_> = forth.iter().map(|p| PointPair { a: p.b, b: p.a, weight: p.weight }).collect();
            let (forth, back) = (fit_rigid(&forth).unwrap(), fit_rigid(&back).unwrap());
            let identity = forth.transform_a_b * back.transform_a_b;
            prop_assert!(identity.translation.vector.norm() < 1e-6);
            prop_assert!(identity.rotation.angle().abs() < 1e-8);
        }

        #[test]
        fn no_other_transform_near_it_has_a_lesser_error(
            points in points(), noise in 0.01..0.3, dx in -0.01..0.01, dy in -0.01..0.01, dyaw in -0.01..0.01,
        ) {
            let mut noisy = pairs(&pose(1.0, 2.0, 3.0), &points);
            for (index, pair) in noisy.iter_mut().enumerate() {
                pair.a.y += noise * ((index % 5) as f64 - 2.0);
            }
            let error = |transform: &Pose2| -> f64 {
                noisy.iter().map(|p| p.weight * (p.a - transform * p.b).norm_squared()).sum()
            };
            let best = fit_rigid(&noisy).unwrap().transform_a_b;
            prop_assert!(error(&best) <= error(&(best * pose(dx, dy, dyaw))) + 1e-9);
        }
    }

    #[test]
    fn a_mirrored_set_is_not_fitted_by_a_reflection() {
        let shape = [(0.0, 0.0), (4.0, 0.0), (0.0, 1.0), (4.0, 3.0)];
        let mirrored: Vec<_> = shape
            .iter()
            .map(|&(x, y)| PointPair { a: Point2::new(x, -y), b: Point2::new(x, y), weight: 1.0 })
            .collect();
        let fit = fit_rigid(&mirrored).unwrap();
        assert!((fit.transform_a_b.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
        assert!(fit.rms > 0.5, "{}", fit.rms);
    }

    #[test]
    fn points_that_do_not_determine_the_rotation_give_none() {
        let pair =
            |ax: f64, bx: f64, weight: f64| PointPair { a: Point2::new(ax, 7.0), b: Point2::new(bx, 7.0), weight };
        assert_eq!(fit_rigid(&[]), None);
        assert_eq!(fit_rigid(&[pair(1.0, 2.0, 1.0)]), None);
        assert_eq!(fit_rigid(&[pair(1.0, 2.0, 1.0); 5]), None);
        assert_eq!(fit_rigid(&[pair(1.0, 2.0, 1.0), pair(1.0, 3.0, 1.0)]), None, "one place in a");
        assert_eq!(fit_rigid(&[pair(1.0, 2.0, 1.0), pair(2.0, 3.0, 0.0)]), None, "one weight is zero");
        assert_eq!(fit_rigid(&[pair(1.0, 2.0, 1.0), pair(f64::NAN, 3.0, 1.0)]), None, "one is no number");
        let square = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let reflected = square.map(|(x, y)| PointPair { a: Point2::new(-x, y), b: Point2::new(x, y), weight: 1.0 });
        assert_eq!(fit_rigid(&reflected), None, "a reflected square fits every rotation as badly");
    }

    #[test]
    fn the_covariance_of_a_transform_about_a_point_is_that_of_the_point() {
        let (transform_a_b, b) = (pose(3.0, -2.0, 0.8), Point2::new(5.0, 7.0));
        let of_place = Matrix2::new(0.04, 0.01, 0.01, 0.09);
        let covariance = covariance_about(&transform_a_b, &b, &of_place, 0.02);
        let at = |point: &Point2| {
            let jacobian = point_jacobian(&transform_a_b, point);
            jacobian * covariance * jacobian.transpose()
        };
        assert!((at(&b) - of_place).norm() < 1e-12, "{}", at(&b));
        // A metre away the turn moves it across.
        let along = of_place
            + transform_a_b.rotation.to_rotation_matrix().matrix()
                * Matrix2::new(0.0, 0.0, 0.0, 0.02)
                * transform_a_b.rotation.to_rotation_matrix().matrix().transpose();
        assert!((at(&(b + Vector2::new(1.0, 0.0))) - along).norm() < 1e-12);
    }

    #[test]
    fn a_half_turn_is_found() {
        let fit = fit_rigid(&pairs(&pose(1.0, 1.0, PI), &[(0.0, 0.0, 1.0), (3.0, 1.0, 1.0)])).unwrap();
        assert!(turn_difference(fit.transform_a_b.rotation.angle(), PI, TAU).abs() < 1e-12);
    }

    #[test]
    fn the_covariance_is_that_of_repeated_fits() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, Normal};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let noise = Normal::new(0.0, 0.05).unwrap();
        let truth = pose(3.0, -2.0, 0.8);
        let clean = pairs(&truth, &[(5.0, 5.0, 400.0), (9.0, 4.0, 400.0), (7.0, 8.0, 400.0), (6.0, 2.0, 400.0)]);
        let mut sum = Matrix3::zeros();
        let runs = 4000;
        let mut expected = Matrix3::zeros();
        for _ in 0..runs {
            let mut noisy = clean.clone();
            for pair in &mut noisy {
                pair.a.x += noise.sample(&mut random);
                pair.a.y += noise.sample(&mut random);
            }
            let fit = fit_rigid(&noisy).unwrap();
            let offset = fit.transform_a_b.translation.vector - truth.translation.vector;
            let turn = turn_difference(fit.transform_a_b.rotation.angle(), 0.8, TAU);
            let error = nalgebra::Vector3::new(offset.x, offset.y, turn);
            sum += error * error.transpose() / f64::from(runs);
            expected += fit.covariance / f64::from(runs);
        }
        assert!((sum - expected).norm() < 0.1 * expected.norm(), "{sum} {expected}");
    }
}

//! The product of the rings of one tag, as a function of the place.

use crate::geometry::Point2;
use std::f64::consts::TAU;

/// How many factors are multiplied before their logarithm is taken: fewer than underflow.
const FACTORS: usize = 8;
/// The least factor: the smallest double is about `LEAST_FACTOR` to the power of `FACTORS`.
const LEAST_FACTOR: f64 = 1e-37;
/// `exp` of less than this is nothing beside the share of outliers.
const NOTHING: f64 = -50.0;

/// "The tag lies about `radius` from `centre`."
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Where the robot was, metres, map frame.
    pub centre: Point2,
    /// Distance to the tag, metres.
    pub radius: f64,
    /// Variance of the distance, square metres.
    pub variance: f64,
}

/// A ring, ready to be evaluated.
#[derive(Clone, Copy, Debug)]
struct Factor {
    x: f64,
    y: f64,
    radius: f64,
    /// `-1 / (2 variance)`
    scale: f64,
    /// The chance of an outlier, relative to the height of the ring.
    floor: f64,
}

/// The product of rings `f_t(x) = exp(-(|x - P| - D)^2 / (2 sigma^2))`, each mixed with a share of outliers.
#[derive(Clone, Debug)]
pub struct RingProduct {
    factors: Vec<Factor>,
    inlier_share: f64,
}

impl RingProduct {
    /// The product of `rings`. `outlier_share` of the readings have any range up to `reach` with the same probability;
    /// 0 is the pure product.
    pub fn new(rings: impl Iterator<Item = Ring>, outlier_share: f64, reach: f64) -> Self {
        let factor = |ring: Ring| Factor {
            x: ring.centre.x,
            y: ring.centre.y,
            radius: ring.radius,
            scale: -0.5 / ring.variance,
            // The density 1 / reach over that of the ring's middle, 1 / (sigma sqrt(2 pi)).
            floor: outlier_share * ((ring.variance * TAU).sqrt() / reach).clamp(0.0, 1.0),
        };
        Self { factors: rings.map(factor).collect(), inlier_share: 1.0 - outlier_share }
    }

    /// Whether there are no rings.
    pub fn is_empty(&self) -> bool {
        self.factors.is_empty()
    }

    /// The logarithm of the product at a place, not normalised; at most 0. `None` as soon as it is known to be below
    /// `least`.
    pub fn log_likelihood(&self, place: &Point2, least: f64) -> Option<f64> {
        self.log_likelihood_within(place, 0.0, least)
    }

    /// An upper bound of the logarithm of the product over all places within `radius` of `place`: a distance changes by
    /// no more than the place is moved. `None` as soon as it is known to be below `least`.
    pub fn log_likelihood_within(&self, place: &Point2, radius: f64, least: f64) -> Option<f64> {
        // Neighbours in the list are neighbours on the drive and say much the same: taking them with a stride tells
        // early that a place is out of the question.
        let stride = self.factors.len().div_ceil(FACTORS).max(1);
        let mut sum = 0.0;
        for start in 0..stride {
            let factors = self.factors.get(start..).unwrap_or_default().iter().step_by(stride);
            sum += match self.inlier_share < 1.0 {
                true => self.log_of_mixtures(factors, place, radius),
                false => factors.map(|factor| factor.exponent(place, radius)).sum(),
            };
            if sum < least {
                return None;
            }
        }
        // A sum that is no number is a place that cannot be.
        (sum >= least).then_some(sum)
    }

    fn log_of_mixtures<'a>(&self, factors: impl Iterator<Item = &'a Factor>, place: &Point2, radius: f64) -> f64 {
        let product: f64 = factors
            .map(|factor| {
                let exponent = factor.exponent(place, radius);
                let ring = if exponent > NOTHING { self.inlier_share * exponent.exp() } else { 0.0 };
                (ring + factor.floor).max(LEAST_FACTOR)
            })
            .product();
        product.ln()
    }
}

impl Factor {
    /// `-(|x - P| - D)^2 / (2 sigma^2)`, or its largest value within `radius` of x.
    #[inline]
    fn exponent(&self, place: &Point2, radius: f64) -> f64 {
        let (x, y) = (place.x - self.x, place.y - self.y);
        let error = (((x * x + y * y).sqrt() - self.radius).abs() - radius).max(0.0);
        error * error * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rings(count: usize) -> impl Iterator<Item = Ring> + Clone {
        (0..count).map(|index| {
            let step = index as f64;
            let centre = Point2::new(0.1 * step, (0.7 * step).sin());
            Ring { centre, radius: 1.0 + 0.3 * (1.3 * step).cos(), variance: 0.0025 + 0.0001 * step }
        })
    }

    /// The equation as it stands.
    fn plain(place: &Point2, count: usize, outlier_share: f64) -> f64 {
        rings(count)
            .map(|ring| {
                let error = (place - ring.centre).norm() - ring.radius;
                let gaussian = (-error * error / (2.0 * ring.variance)).exp();
                let uniform = (ring.variance * TAU).sqrt() / 3.0;
                ((1.0 - outlier_share) * gaussian + outlier_share * uniform).ln()
            })
            .sum()
    }

    #[test]
    fn it_is_the_sum_of_the_logarithms_of_the_rings() {
        for count in [1, 7, 8, 9, 30] {
            let product = RingProduct::new(rings(count), 0.05, 3.0);
            for place in [Point2::new(0.3, 0.9), Point2::new(-1.0, 0.2), Point2::new(1.0, 1.0)] {
                let value = product.log_likelihood(&place, f64::NEG_INFINITY).unwrap();
                assert!((value - plain(&place, count, 0.05)).abs() < 1e-9);
            }
        }
        let pure = RingProduct::new(rings(3), 0.0, 3.0);
        let place = Point2::new(0.2, 1.2);
        assert!((pure.log_likelihood(&place, f64::NEG_INFINITY).unwrap() - plain(&place, 3, 0.0)).abs() < 1e-9);
    }

    #[test]
    fn a_thousand_rings_far_off_do_not_underflow() {
        let ring = Ring { centre: Point2::origin(), radius: 1.0, variance: 1e-4 };
        for outlier_share in [0.0, 1e-300, 0.01] {
            let product = RingProduct::new(std::iter::repeat_n(ring, 1000), outlier_share, 3.0);
            let value = product.log_likelihood(&Point2::new(3.0, 0.0), f64::NEG_INFINITY).unwrap();
            assert!(value.is_finite() && value < -1000.0, "{value}");
        }
    }

    proptest! {
        #[test]
        fn no_place_within_the_radius_exceeds_the_bound(
            x in -2.0..4.0, y in -3.0..3.0, radius in 0.0..1.0, angle in 0.0..7.0, share in 0.0..1.0, pure: bool,
        ) {
            let product = RingProduct::new(rings(20), if pure { 0.0 } else { 0.02 }, 3.0);
            let middle = Point2::new(x, y);
            let place = Point2::new(x + share * radius * f64::cos(angle), y + share * radius * f64::sin(angle));
            let bound = product.log_likelihood_within(&middle, radius, f64::NEG_INFINITY).unwrap();
            let value = product.log_likelihood(&place, f64::NEG_INFINITY).unwrap();
            prop_assert!(value <= bound + 1e-9);
        }

        #[test]
        fn it_gives_up_only_below_the_least(x in -2.0..4.0, y in -3.0..3.0, least in -300.0..0.0) {
            let product = RingProduct::new(rings(20), 0.02, 3.0);
            let place = Point2::new(x, y);
            let value = product.log_likelihood(&place, f64::NEG_INFINITY).unwrap();
            prop_assert_eq!(product.log_likelihood(&place, least), (value >= least).then_some(value));
        }
    }
}

//! Product of the rings of one tag, as a function of its position.

use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

/// Number of factors that are evaluated together, and multiplied before their logarithm is taken: fewer than
/// underflow.
const LANES: usize = 8;
/// Least factor: the smallest double is about `LEAST_FACTOR` to the power of `LANES`.
const LEAST_FACTOR: f64 = 1e-37;
/// `exp` of less than this is negligible beside a share of outliers.
const NOTHING: f64 = -50.0;

/// A measurement of the distance `radius` to the tag from `centre`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Position of the robot, metres, map frame.
    pub centre: Point2,
    /// Distance to the tag, metres.
    pub radius: f64,
    /// Variance of the distance, square metres.
    pub variance: f64,
}

/// Rings that are evaluated together. Unused lanes hold factors of 1.
#[derive(Clone, Copy, Debug)]
struct Block {
    x: [f64; LANES],
    y: [f64; LANES],
    radius: [f64; LANES],
    /// `-1 / (2 variance)`
    scale: [f64; LANES],
    inlier_share: [f64; LANES],
    /// Density of an outlier, relative to the height of the ring.
    floor: [f64; LANES],
    /// The product far away from all rings.
    all_outliers: f64,
}

/// The product of rings `f_t(x) = exp(-(|x - P| - D)^2 / (2 sigma^2))`, each mixed with a share of outliers.
#[derive(Clone, Debug)]
pub struct RingProduct {
    blocks: Vec<Block>,
    pure: bool,
}

impl RingProduct {
    /// The product of `rings`. A share `outlier_share` of the readings are uniform over ranges up to `reach`; 0 is
    /// the pure product.
    pub fn new(rings: impl Iterator<Item = Ring>, outlier_share: f64, reach: f64) -> Self {
        let rings: Vec<Ring> = rings.collect();
        let ones = Block {
            x: [0.0; LANES],
            y: [0.0; LANES],
            radius: [0.0; LANES],
            scale: [0.0; LANES],
            inlier_share: [1.0; LANES],
            floor: [0.0; LANES],
            all_outliers: 1.0,
        };
        // Neighbours in the list are neighbours on the drive and hardly differ. Distributing them over the blocks
        // lets the first blocks rule out a position.
        let mut blocks = vec![ones; rings.len().div_ceil(LANES)];
        let count = blocks.len().max(1);
        for (index, ring) in rings.iter().enumerate() {
            let (block, lane) = (index % count, index / count);
            let Some(block) = blocks.get_mut(block) else { continue };
            block.x[lane] = ring.centre.x;
            block.y[lane] = ring.centre.y;
            block.radius[lane] = ring.radius;
            block.scale[lane] = -0.5 / ring.variance;
            block.inlier_share[lane] = 1.0 - outlier_share;
            // The density 1 / reach over the peak of the ring, 1 / (sigma sqrt(2 pi)).
            block.floor[lane] = outlier_share * ((ring.variance * TAU).sqrt() / reach).clamp(0.0, 1.0);
            block.all_outliers *= block.floor[lane].max(LEAST_FACTOR);
        }
        Self { blocks, pure: 1.0 - outlier_share == 1.0 }
    }

    /// Whether there are no rings.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Logarithm of the product at a point, not normalised; at most 0. `None` as soon as it is known to be below
    /// `least`.
    pub fn log_likelihood(&self, place: &Point2, least: f64) -> Option<f64> {
        self.log_likelihood_within(place, 0.0, least)
    }

    /// Upper bound of the logarithm of the product over all points within `radius` of `place`: a distance changes by
    /// no more than the point moves. `None` as soon as it is known to be below `least`.
    pub fn log_likelihood_within(&self, place: &Point2, radius: f64, least: f64) -> Option<f64> {
        let mut sum = 0.0;
        for block in &self.blocks {
            let exponents = block.exponents(place, radius);
            sum += match self.pure {
                true => exponents.iter().sum(),
                false => block.mixture(&exponents).ln(),
            };
            if sum < least {
                return None;
            }
        }
        Some(sum)
    }
}

impl RingProduct {
    /// Fisher information at a point of the rings through it, over x and y, one over square metres.
    pub fn information(&self, place: &Point2) -> Matrix2<f64> {
        let mut information = Matrix2::zeros();
        for block in &self.blocks {
            let exponents = block.exponents(place, 0.0);
            for (lane, exponent) in exponents.into_iter().enumerate() {
                let offset = Vector2::new(place.x - block.x[lane], place.y - block.y[lane]);
                let inlier = block.inlier_share[lane] * exp(exponent);
                let share = if self.pure { 1.0 } else { inlier / (inlier + block.floor[lane]) };
                let along = offset / offset.norm().max(f64::MIN_POSITIVE);
                information += along * along.transpose() * (-2.0 * share * block.scale[lane]);
            }
        }
        information
    }
}

impl Block {
    /// `-(|x - P| - D)^2 / (2 sigma^2)`, or its largest value within `radius` of x.
    #[inline]
    fn exponents(&self, place: &Point2, radius: f64) -> [f64; LANES] {
        std::array::from_fn(|lane| {
            let (x, y) = (place.x - self.x[lane], place.y - self.y[lane]);
            let error = (((x * x + y * y).sqrt() - self.radius[lane]).abs() - radius).max(0.0);
            error * error * self.scale[lane]
        })
    }

    /// The product of the rings with their share of outliers.
    #[inline]
    fn mixture(&self, exponents: &[f64; LANES]) -> f64 {
        if exponents.iter().all(|exponent| *exponent < NOTHING) {
            return self.all_outliers;
        }
        let factors: [f64; LANES] = std::array::from_fn(|lane| {
            (self.inlier_share[lane] * exp(exponents[lane]) + self.floor[lane]).max(LEAST_FACTOR)
        });
        factors.iter().product()
    }
}

/// `exp` of a value that is at most 0, to 10 digits; below -700 it is that of -700.
///
/// It has no branches, so the compiler vectorises it, and it gives the same bits on every machine.
#[inline]
fn exp(value: f64) -> f64 {
    /// Adding it leaves no bits for a fraction: 1.5 * 2^52.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let value = value.max(-700.0);
    // value = n ln 2 + rest, with |rest| at most ln 2 / 2.
    let rounded = value * std::f64::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let rest = value - n * LN_2_HIGH - n * LN_2_LOW;
    // The series of exp, from the last term on.
    let mut power = 1.0;
    for divisor in [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0] {
        power = 1.0 + power * rest * (1.0 / divisor);
    }
    // The last bits of `rounded` are n: shifted to the exponent of a double they make 2^n.
    power * f64::from_bits((rounded.to_bits() << 52).wrapping_add(1f64.to_bits()))
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

    /// The equation as printed.
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

    #[test]
    fn the_exponential_is_exact() {
        assert_eq!(exp(0.0), 1.0);
        for step in 0..7000 {
            let value = -0.1 * f64::from(step);
            assert!((exp(value) / value.exp() - 1.0).abs() < 1e-10, "{value}");
        }
        assert!(exp(f64::NEG_INFINITY) < 1e-300);
    }

    proptest! {
        #[test]
        fn no_point_within_the_radius_exceeds_the_bound(
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
        fn it_stops_early_only_below_the_least(x in -2.0..4.0, y in -3.0..3.0, least in -300.0..0.0) {
            let product = RingProduct::new(rings(20), 0.02, 3.0);
            let place = Point2::new(x, y);
            let value = product.log_likelihood(&place, f64::NEG_INFINITY).unwrap();
            prop_assert_eq!(product.log_likelihood(&place, least), (value >= least).then_some(value));
        }
    }
}

//! Product of the rays of one tag, as a function of its position.

use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

/// Least distance of a position from the sensor, metres: at less, the direction is undefined.
const NEAREST: f64 = 1e-6;

/// A measurement of the direction `bearing` to the tag from `origin`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Position of the sensor, metres, map frame.
    pub origin: Point2,
    /// Direction to the tag, radians, map frame.
    pub bearing: f64,
    /// Variance of the direction, square radians.
    pub variance: f64,
    /// Variance of the sensor's position, along any direction, square metres.
    pub origin_variance: f64,
}

/// Product of rays, each mixed with a share of outliers.
///
/// An error of the sensor's position turns the direction to a tag the more, the nearer the tag is: at distance d the
/// direction has the variance `v(d) = variance + origin_variance / d^2`. A ray is the density of its direction,
/// relative to its largest value: `sqrt(variance / v(d)) exp(-error^2 / (2 v(d)))`.
#[derive(Clone, Debug)]
pub struct RayProduct {
    rays: Vec<(Ray, Vector2<f64>)>,
    outlier_share: f64,
}

impl RayProduct {
    /// The product of `rays`. A share `outlier_share` of the bearings are uniform over directions; 0 is the pure
    /// product.
    pub fn new(rays: impl Iterator<Item = Ray>, outlier_share: f64) -> Self {
        let with_direction = |ray: Ray| (ray, Vector2::new(ray.bearing.cos(), ray.bearing.sin()));
        Self { rays: rays.map(with_direction).collect(), outlier_share }
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Upper bound of the logarithm of the product over all points within `radius` of `place`, not normalised; at
    /// most 0. `None` as soon as it is known to be below `least`.
    pub fn log_likelihood_within(&self, place: &Point2, radius: f64, least: f64) -> Option<f64> {
        let mut sum = 0.0;
        for (ray, direction) in &self.rays {
            let (height, exponent) = ray.bound(direction, place, radius);
            sum += match self.outlier_share > 0.0 {
                true => (self.inlier(height, exponent) + self.floor(ray)).max(f64::MIN_POSITIVE).ln(),
                false => height.max(f64::MIN_POSITIVE).ln() + exponent,
            };
            if sum < least {
                return None;
            }
        }
        Some(sum)
    }

    /// Fisher information at a point of the rays through it, over x and y, one over square metres.
    pub fn information(&self, place: &Point2) -> Matrix2<f64> {
        let mut information = Matrix2::zeros();
        for (ray, direction) in &self.rays {
            let (height, exponent) = ray.bound(direction, place, 0.0);
            let inlier = self.inlier(height, exponent);
            let share = inlier / (inlier + self.floor(ray)).max(f64::MIN_POSITIVE);
            let offset = place - ray.origin;
            let distance = offset.norm().max(NEAREST);
            let across = Vector2::new(-offset.y, offset.x) / distance;
            information += across * across.transpose() * (share / (distance * distance * ray.variance_at(distance)));
        }
        information
    }

    fn inlier(&self, height: f64, exponent: f64) -> f64 {
        (1.0 - self.outlier_share) * height * exponent.exp()
    }

    /// Density of an outlier: 1 / (2 pi) over the largest value of the ray, 1 / (sigma sqrt(2 pi)).
    fn floor(&self, ray: &Ray) -> f64 {
        self.outlier_share * (ray.variance / TAU).sqrt().min(1.0)
    }
}

impl Ray {
    /// Variance of the direction at a distance in metres, square radians.
    fn variance_at(&self, distance: f64) -> f64 {
        self.variance + self.origin_variance / (distance * distance)
    }

    /// Largest height and exponent of the density over all points within `radius` of `place`.
    fn bound(&self, direction: &Vector2<f64>, place: &Point2, radius: f64) -> (f64, f64) {
        let offset = place - self.origin;
        let distance = offset.norm();
        let height = (self.variance / self.variance_at((distance + radius).max(NEAREST))).sqrt();
        if distance <= radius {
            return (height, 0.0);
        }
        let error = direction.perp(&offset).atan2(direction.dot(&offset)).abs();
        // From the sensor, the circle around the point spans this angle to either side.
        let error = (error - (radius / distance).asin()).max(0.0);
        (height, -error * error / (2.0 * self.variance_at((distance - radius).max(NEAREST))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rays(count: usize) -> impl Iterator<Item = Ray> + Clone {
        (0..count).map(|index| {
            let step = index as f64;
            let origin = Point2::new(0.1 * step, (0.7 * step).sin());
            let (variance, origin_variance) = (0.0025 + 0.0001 * step, 0.0004 * (step % 3.0));
            Ray { origin, bearing: 1.0 + 0.1 * step, variance, origin_variance }
        })
    }

    #[test]
    fn rays_from_two_positions_cross_at_the_tag() {
        let tag = Point2::new(2.0, 3.0);
        let ray = |x: f64| {
            let origin = Point2::new(x, 0.0);
            let offset = tag - origin;
            Ray { origin, bearing: offset.y.atan2(offset.x), variance: 0.01, origin_variance: 0.0 }
        };
        let product = RayProduct::new([ray(0.0), ray(4.0)].into_iter(), 0.0);
        let value = |x: f64, y: f64| product.log_likelihood_within(&Point2::new(x, y), 0.0, f64::NEG_INFINITY).unwrap();
        assert!(value(2.0, 3.0).abs() < 1e-9);
        for (x, y) in [(2.5, 3.0), (2.0, 4.0), (2.0, -3.0), (0.0, 0.0)] {
            assert!(value(x, y) < -0.5, "{x} {y}: {}", value(x, y));
        }
    }

    #[test]
    fn many_rays_that_miss_do_not_underflow_and_an_invalid_point_is_none() {
        for outlier_share in [0.0, 1e-300, 0.02] {
            let product = RayProduct::new(rays(20).cycle().take(2000), outlier_share);
            for place in [Point2::origin(), Point2::new(-3.0, -3.0), Point2::new(0.1, 0.7f64.sin())] {
                let value = product.log_likelihood_within(&place, 0.0, f64::NEG_INFINITY).unwrap();
                assert!(value.is_finite() && value < -100.0, "{value}");
                assert!(product.information(&place).iter().all(|value| value.is_finite()));
            }
        }
    }

    proptest! {
        #[test]
        fn no_point_within_the_radius_exceeds_the_bound(
            x in -2.0..4.0, y in -3.0..3.0, radius in 0.0..2.0, angle in 0.0..7.0, share in 0.0..1.0, pure: bool,
        ) {
            let product = RayProduct::new(rays(20), if pure { 0.0 } else { 0.02 });
            let middle = Point2::new(x, y);
            let place = Point2::new(x + share * radius * f64::cos(angle), y + share * radius * f64::sin(angle));
            let bound = product.log_likelihood_within(&middle, radius, f64::NEG_INFINITY).unwrap();
            let value = product.log_likelihood_within(&place, 0.0, f64::NEG_INFINITY).unwrap();
            prop_assert!(value <= bound + 1e-9 && bound <= 0.0);
        }
    }
}

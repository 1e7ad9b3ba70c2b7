//! Likelihood of a tag's position by all of its readings.

use super::{Ray, RayProduct, Ring, RingProduct, largest_variance};
use crate::shared::geometry::Point2;

/// Product of the rings and the rays of one tag.
#[derive(Clone, Debug)]
pub struct Likelihood {
    rings: RingProduct,
    rays: RayProduct,
}

impl Likelihood {
    /// The product of `rings` and `rays`. A share `outlier_share` of the readings are uniform, over ranges up to
    /// `reach`, in metres, or over directions.
    pub fn new(
        rings: impl Iterator<Item = Ring>,
        rays: impl Iterator<Item = Ray>,
        outlier_share: f64,
        reach: f64,
    ) -> Self {
        Self { rings: RingProduct::new(rings, outlier_share, reach), rays: RayProduct::new(rays, outlier_share) }
    }

    /// The product of rings alone.
    pub fn of_rings(rings: impl Iterator<Item = Ring>, outlier_share: f64, reach: f64) -> Self {
        Self::new(rings, std::iter::empty(), outlier_share, reach)
    }

    /// Whether there are no readings.
    pub fn is_empty(&self) -> bool {
        self.rings.is_empty() && self.rays.is_empty()
    }

    /// Logarithm of the product at a point, not normalised; at most 0. `None` as soon as it is known to be below
    /// `least`.
    pub fn log_likelihood(&self, place: &Point2, least: f64) -> Option<f64> {
        self.log_likelihood_within(place, 0.0, least)
    }

    /// Upper bound of the logarithm of the product over all points within `radius` of `place`. `None` as soon as it
    /// is known to be below `least`.
    pub fn log_likelihood_within(&self, place: &Point2, radius: f64, least: f64) -> Option<f64> {
        let rings = self.rings.log_likelihood_within(place, radius, least)?;
        Some(rings + self.rays.log_likelihood_within(place, radius, least - rings)?)
    }

    /// Standard deviation of the tag at a point along its most certain direction, metres: from the Fisher information
    /// of the rings and rays through that point.
    pub fn narrowest_stddev(&self, place: &Point2) -> f64 {
        largest_variance(&(self.rings.information(place) + self.rays.information(place))).sqrt().recip()
    }
}

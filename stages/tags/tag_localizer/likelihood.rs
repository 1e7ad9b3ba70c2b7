//! How well a place agrees with all that was heard and seen of one tag.

use super::{Ray, RayProduct, Ring, RingProduct, largest_variance};
use crate::shared::geometry::Point2;

/// The product of the rings and the rays of one tag.
#[derive(Clone, Debug)]
pub struct Likelihood {
    rings: RingProduct,
    rays: RayProduct,
}

impl Likelihood {
    /// The product of `rings` and `rays`. `outlier_share` of the readings have any range up to `reach`, in metres, or any direction
    /// with the same probability.
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

    /// Whether nothing was heard or seen.
    pub fn is_empty(&self) -> bool {
        self.rings.is_empty() && self.rays.is_empty()
    }

    /// The logarithm of the product at a place, not normalised; at most 0. `None` as soon as it is known to be below
    /// `least`.
    pub fn log_likelihood(&self, place: &Point2, least: f64) -> Option<f64> {
        self.log_likelihood_within(place, 0.0, least)
    }

    /// An upper bound of the logarithm of the product over all places within `radius` of `place`. `None` as soon as it is known to
    /// be below `least`.
    pub fn log_likelihood_within(&self, place: &Point2, radius: f64, least: f64) -> Option<f64> {
        let rings = self.rings.log_likelihood_within(place, radius, least)?;
        Some(rings + self.rays.log_likelihood_within(place, radius, least - rings)?)
    }

    /// Standard deviation at a place of the tag along the direction in which the readings tell most, metres: from the Fisher
    /// information of the rings and rays that go through that place.
    pub fn narrowest_stddev(&self, place: &Point2) -> f64 {
        largest_variance(&(self.rings.information(place) + self.rays.information(place))).sqrt().recip()
    }
}

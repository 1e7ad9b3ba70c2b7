//! Searches for the places at which two maps fit, without tags and without a first guess.
//!
//! A search over all rotations and translations by correlation, as in Olson, "Real-time correlative scan matching"
//! (ICRA 2009), of maps in place of scans; for each rotation the score of every translation comes at once from the
//! convolution theorem. Walls on walls count for a place, and walls of one map on known free space of the other against
//! it, which is what tells right from wrong: Birk and Carpin, "Merging occupancy grid maps from multiple robots"
//! (Proceedings of the IEEE 2006), judge by the same.
//!
//! - [`PreparedMap`]: a map in [`Raster`]s of wider and wider cells, and points on its walls.
//! - [`search`]: all places in wide cells, at some [`Rotations`], by a [`Correlator`] that scores every translation of one map on another.
//! - [`Peaks`]: the best of them, each followed up to the peak near it and judged in narrower cells by an [`Overlay`].
//! - [`refine_peak`]: the place to a part of a cell, and [`covariance`], how sure it is.
//! - [`align_maps`]: all of it.

mod align;
mod climb;
mod correlation;
mod fine_search;
mod fourier;
mod lead;
mod overlay;
mod parameters;
mod peak_shape;
mod peaks;
mod places;
mod prepared_map;
mod raster;
mod refusal;
mod scales;
mod walk;

#[cfg(test)]
pub(crate) mod tests;

pub use align::{MapAlignment, MapAlignments, NamedMap, align_maps, align_near, align_prepared, self_similar_places};
pub use climb::{Steps, climb};
pub use correlation::{Correlator, ScoredShift, Workspace};
pub use fine_search::refine_peak;
pub use overlay::{CommonWalls, Overlay, Walls};
pub use parameters::MapAlignerParameters;
pub use peak_shape::covariance;
pub use peaks::Peaks;
pub(crate) use peaks::{is_near, overlay};
pub use places::{Place, Rotations, search};
pub(crate) use prepared_map::JUDGED;
pub use prepared_map::PreparedMap;
pub use raster::{Content, Raster};
pub use refusal::SearchRefusal;

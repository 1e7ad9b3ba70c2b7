//! Searches the relative poses at which two maps fit, without tags and without an initial guess.
//!
//! An exhaustive search over rotations and translations by correlation, as in Olson, "Real-time correlative scan
//! matching" (ICRA 2009), with maps in place of scans; for each rotation the convolution theorem gives the score of
//! every translation at once. Walls on walls are evidence for a pose, walls of one map on known free space of the
//! other are evidence against it: Birk and Carpin, "Merging occupancy grid maps from multiple robots" (Proceedings of
//! the IEEE 2006).
//!
//! - [`PreparedMap`]: a map in [`Raster`]s of increasing cell size, and points on its walls.
//! - [`search`]: all poses in wide cells, at some [`Rotations`], by a [`Correlator`] that scores every translation of
//!   one map on another.
//! - [`Peaks`]: the best of them, each followed to the peak near it and scored in narrower cells by an [`Overlay`].
//! - [`refine_peak`]: the pose to a fraction of a cell, and [`covariance`], its uncertainty.
//! - [`align_maps`]: all of it.

mod align;
mod best_blocks;
mod chance;
mod coordinate_ascent;
mod correlation;
mod exhaustive;
mod fourier;
mod known_cells;
mod lookup;
mod overlay;
mod parameters;
mod peak_shape;
mod peaks;
mod prepared_map;
mod raster;
mod refusal;
mod scales;
mod significance;
mod walk;

#[cfg(test)]
pub(crate) mod tests;

pub use align::{
    MapAlignment, MapAlignments, NamedMap, align_maps, align_near, align_prepared, peak_significance,
    self_similar_poses,
};
pub use coordinate_ascent::{Steps, coordinate_ascent, refine_peak};
pub use correlation::{Correlator, ScoredShift, Workspace};
pub use exhaustive::{Rotations, ScoredPose, search};
pub use known_cells::KnownCells;
pub use overlay::{CommonWalls, Overlay, Walls};
pub use parameters::MapAlignerParameters;
pub use peak_shape::covariance;
pub use peaks::{Extent, Peaks};
pub(crate) use peaks::{is_near, overlay};
pub(crate) use prepared_map::JUDGED;
pub use prepared_map::PreparedMap;
pub use raster::{Content, Raster};
pub use refusal::SearchRefusal;

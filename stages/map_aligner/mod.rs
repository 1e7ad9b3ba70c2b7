//! Finds how two maps lie to each other from the maps alone, without tags and without a first guess.
//!
//! A search over all rotations and translations by correlation, as in Olson, "Real-time correlative scan matching"
//! (ICRA 2009), of maps in place of scans; for each rotation the score of every translation comes at once from the
//! convolution theorem. Walls on walls count for a place, and walls of one map on known free space of the other against
//! it, which is what tells right from wrong: Birk and Carpin, "Merging occupancy grid maps from multiple robots"
//! (Proceedings of the IEEE 2006), judge by the same.
//!
//! - [`Raster`]: a map in wider cells, cropped to what is known, turned by any angle.
//! - [`Correlator`]: the score of every translation of one raster on another.
//! - [`search`]: the best place, and the best one elsewhere.
//! - [`refine_peak`]: the place to half a cell.
//! - [`align_maps`]: all of it, and whether the outcome can be believed.

mod align;
mod climb;
mod correlation;
mod fine_search;
mod fourier;
mod overlay;
mod parameters;
mod peak_shape;
mod peaks;
mod prepared_map;
mod raster;
mod refusal;
mod search;
mod stage;

#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod tests;

pub use align::{MapAlignment, MapAlignments, NamedMap, align_maps, align_prepared};
pub use climb::{Steps, climb};
pub use correlation::{Correlator, ScoredShift, Workspace};
pub use fine_search::refine_peak;
pub use overlay::{CommonWalls, Overlay, Walls};
pub use parameters::MapAlignerParameters;
pub use peak_shape::covariance;
pub use peaks::Peaks;
pub use prepared_map::PreparedMap;
pub use raster::{Content, Raster};
pub use refusal::Refusal;
pub use search::{Place, search};

use gridweave_runtime::ros::{Alignment, OccupancyGrid};
use gridweave_runtime::stage::{InputPort, OutputPort, PortType, StageKind};

/// The stage kind `map_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_aligner",
        "Finds how the maps of each pair of robots lie to each other from the maps alone: every rotation and every \
         translation is tried, and a place is taken where walls lie on walls, and no other place is nearly as good. It \
         sends a first guess, marked as provisional, which icp_refiner makes exact and verifies.",
        vec![InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "The robots' maps.")],
        vec![OutputPort::new(
            "alignment",
            PortType::of::<Alignment>(),
            "A first guess for each pair of robots, or why there is none.",
        )],
        |parameters: MapAlignerParameters, _context| Ok(stage::MapAligner::new(parameters)),
    )
}

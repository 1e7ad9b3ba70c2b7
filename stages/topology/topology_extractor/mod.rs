//! Extracts a topological map from an occupancy grid: its nodes and the paths between them.
//!
//! The paths are the skeleton of the free space (see [`skeleton`](crate::topology::skeleton)), its ends and junctions
//! are nodes, and so are doors: where a path is narrow, and wide before and after. Wang, Wang, Liu and Zheng ("An
//! efficient method of multi-robots topological map building") draw such maps by hand.
//!
//! - [`extract`]: all of it.
//! - [`doors`]: their positions along a path.
//! - [`simplify`]: a path by few points.

mod doors;
mod extract;
mod parameters;
mod simplify;
mod stage;

#[cfg(test)]
mod tests;

pub use doors::doors;
pub use extract::{ExtractedTopology, extract};
pub use parameters::TopologyExtractorParameters;
pub use simplify::simplify;

use gridweave_runtime::stage::StageKind;
use stage::TopologyExtractor;

/// The stage kind `topology_extractor`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "topology_extractor",
        "Extracts the topological map of a map: the lines at the same distance from the walls to both sides, as paths between \
         their ends, junctions and doors.",
        |parameters: TopologyExtractorParameters, _| Ok(TopologyExtractor { parameters }),
    )
    .input("map", "The robots' maps.", TopologyExtractor::receive_map)
    .build()
}

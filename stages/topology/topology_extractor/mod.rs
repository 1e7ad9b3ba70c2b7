//! Finds the places of a map and the ways between them: from an occupancy grid to a topological map.
//!
//! The ways are the skeleton of the free space (see [`skeleton`](crate::topology::skeleton)), its ends and junctions are places, and so
//! are doors: where a way is narrow, and wide before and behind. Wang, Wang, Liu and Zheng ("An efficient method of
//! multi-robots topological map building") draw such maps by hand.
//!
//! - [`extract`]: all of it.
//! - [`doors`]: where along a way they are.
//! - [`simplify`]: a way by few points.

mod doors;
mod extract;
mod parameters;
mod simplify;
mod stage;

#[cfg(test)]
mod tests;

pub use doors::doors;
pub use extract::{Topology, extract};
pub use parameters::TopologyExtractorParameters;
pub use simplify::simplify;

use gridweave_runtime::stage::StageKind;
use stage::TopologyExtractor;

/// The stage kind `topology_extractor`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "topology_extractor",
        "Finds the places of a map and the ways between them: the lines that keep the same distance from the walls to both sides, \
         with their ends, junctions and doors.",
        |parameters: TopologyExtractorParameters, _| Ok(TopologyExtractor { parameters }),
    )
    .input("map", "The robots' maps.", TopologyExtractor::receive_map)
    .build()
}

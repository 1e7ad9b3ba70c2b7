//! Fuses maps on the cells of one lattice by the entropy filter.
//!
//! The last step of Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a topological approach to map merging for
//! multiple robots" (IEEE Robotics and Automation Magazine, June 2014), section "Map Fusion with the Entropy Filter":
//! the log-odds of two maps (equation 7) are added, and the sum is kept only where its entropy is not above that of
//! the better input. Where the maps agree the sum is more certain than both, and is kept; where they contradict each
//! other it is less certain, and the more certain map counts. So a wall that is blurred in one map, whose pose is
//! uncertain, does not reduce the evidence of the other.
//!
//! What the paper leaves open, and how it is decided here:
//! - **More than two maps** are fused one after the other: the reference robot's first, and then by the robots'
//!   names. The filter keeps or drops whole values, so the order matters where three maps contradict each other.
//! - **Two maps of equal certainty for opposite states**: the sum is 0, and the earlier map counts.
//! - **Unknown cells** have log-odds of 0: the other map counts. A cell that no map knows stays unknown.
//!
//! - [`entropy_filter`]: the filter on one cell.
//! - [`fuse`]: the filter on maps.

mod fuse;
mod parameters;
mod stage;
#[cfg(test)]
mod tests;

pub use fuse::{LeftOut, common_grid, entropy_filter, fuse};
pub use parameters::EntropyFuserParameters;

use gridweave_runtime::stage::StageKind;
use stage::EntropyFuser;

/// The stage kind `entropy_fuser`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "entropy_fuser",
        "Fuses maps that lie on the cells of one lattice, as `uncertain_transform` sends them, in log-odds: the sum is kept where it \
         is not less certain than the more certain map, and else that map counts (Saeedi et al., \"Group mapping\").",
        |parameters: EntropyFuserParameters, _| Ok(EntropyFuser::new(parameters)),
    )
    .input("map", "The robots' maps in the world, on the cells of one lattice.", EntropyFuser::receive_map)
    .input("frames", "Which robots are placed, and which of them is the reference.", EntropyFuser::receive_frames)
    .finish(EntropyFuser::finish)
    .build()
}

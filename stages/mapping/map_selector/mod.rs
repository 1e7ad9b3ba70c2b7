//! Picks of the maps that robots send those that tell something, so that a merge costs what the robots have seen and not
//! how often they tell of it.
//!
//! A robot publishes its map every few seconds, and hardly anything in it differs from the one before. Places are searched
//! and judged on maps that have changed by a share of what was known; and at the end on the last map of each robot, whatever
//! has changed in it. As maps grow, each that is picked knows more than the one before by that share, so that their number
//! goes with the logarithm of what is known.
//!
//! - [`changed_cells`]: how much of a map is another than in the one before.

mod change;
mod parameters;
mod stage;

#[cfg(test)]
mod tests;

pub use change::{changed_cells, known_cells};
pub use parameters::MapSelectorParameters;

use gridweave_runtime::stage::StageKind;
use stage::MapSelector;

/// The stage kind `map_selector`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_selector",
        "Passes on the maps that tell something: of each robot the first, then each that has changed by at least \
         `min_change` since the one passed on before, and at the end the last. The stages that compare and fuse maps need \
         not look at those that lie between.",
        |parameters: MapSelectorParameters, _| Ok(MapSelector::new(parameters)),
    )
    .inputs("map", "The robots' maps.", MapSelector::receive_map)
    .finish(MapSelector::finish)
    .build()
}

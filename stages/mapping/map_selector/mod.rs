//! Selects the maps that differ enough from the one before, so that a merge costs in proportion to the known area,
//! and not to the rate of the maps.
//!
//! A robot publishes its map every few seconds, and hardly anything in it differs from the one before. Relative poses
//! are searched and judged on maps that have changed by a share of the known area; and at the end on the last map of
//! each robot, whatever has changed in it. As maps grow, each selected one knows more than the one before by that
//! share, so their number grows with the logarithm of the known area.
//!
//! - [`changed_cells`]: number of cells that differ from the map before.

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
        "Passes on the maps that differ enough: of each robot the first, then each that has changed by at least \
         `min_change` since the one passed on before, and at the end the last. The stages that compare and fuse maps need \
         not process those between.",
        |parameters: MapSelectorParameters, _| Ok(MapSelector::new(parameters)),
    )
    .inputs("map", "The robots' maps.", MapSelector::receive_map)
    .finish(MapSelector::finish)
    .build()
}

//! Removes everything that is no wall from a map, for the stages that compare maps; the merged map keeps what the
//! robots saw.
//!
//! Walls are the same for every robot and on every day. People, legs of furniture, dust and reflections in glass are
//! not: they are evidence against right poses, and for wrong ones.
//!
//! - [`clean`]: objects that are too small for walls, and known space that is too narrow, become unknown.

mod clean;
mod objects;
mod parameters;
mod passages;
mod stage;

#[cfg(test)]
mod tests;

pub use clean::clean;
pub use parameters::MapCleanerParameters;

use gridweave_runtime::stage::StageKind;
use stage::MapCleaner;

/// The stage kind `map_cleaner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_cleaner",
        "Clears maps of what is no wall, for the stages that compare them: single cells and small objects, as people, legs \
         and dust leave them, and known space that is narrower than a robot, as rays through glass and open doors leave it. \
         They become unknown, which says nothing for or against a place.",
        |parameters: MapCleanerParameters, _| Ok(MapCleaner { parameters }),
    )
    .input("map", "The robots' maps.", MapCleaner::receive_map)
    .build()
}

//! Plans which maps of many robots are searched for their places on each other, and sends what was found.
//!
//! The search itself is [`registration::search`](crate::registration::search).

mod group;
mod plan;
mod stage;
mod statement;

#[cfg(test)]
mod plan_tests;
#[cfg(test)]
mod stage_tests;

pub use plan::MergePlan;
pub use statement::Statement;

use crate::registration::search::MapAlignerParameters;
use gridweave_runtime::stage::StageKind;
use stage::MapAligner;

/// The stage kind `map_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_aligner",
        "Finds how the maps of each pair of robots may lie to each other from the maps alone: every rotation and every \
         translation is tried, and the places are taken at which walls lie on walls and not on free space of the other \
         map. It sends the best few, ranked and marked as provisional: icp_refiner makes them exact, and merge_verifier \
         decides between them. Where initial poses are given, only places near them are tried.",
        |parameters: MapAlignerParameters, context| Ok(MapAligner::new(parameters, context.initial_poses.clone())),
    )
    .input("map", "The robots' maps.", MapAligner::receive_map)
    .finish(MapAligner::finish)
    .build()
}

//! Plans which maps of many robots are searched for their relative poses, and sends the hypotheses.
//!
//! The search itself is [`registration::search`](crate::registration::search).

mod group;
mod pair_report;
mod plan;
mod stage;

#[cfg(test)]
mod plan_tests;
#[cfg(test)]
mod stage_tests;

pub use pair_report::PairReport;
pub use plan::MergePlan;

use crate::registration::search::MapAlignerParameters;
use gridweave_runtime::stage::StageKind;
use stage::MapAligner;

/// The stage kind `map_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_aligner",
        "Searches the relative pose of the maps of each pair of robots by the maps only: every rotation and every \
         translation is scored by the walls on walls, less the walls on free space of the other map. It sends the best \
         hypotheses, ranked and marked as provisional: icp_refiner refines them, and merge_verifier decides between them. \
         If initial poses are given, only poses near them are searched.",
        |parameters: MapAlignerParameters, context| Ok(MapAligner::new(parameters, context.initial_poses.clone())),
    )
    .input("map", "The robots' maps.", MapAligner::receive_map)
    .finish(MapAligner::finish)
    .build()
}

//! Non-rigid refinement: deforms the maps of robots that are placed in one world, so that walls that several have
//! seen are aligned, by [`non_rigid`](crate::registration::non_rigid).

mod parameters;
mod stage;
#[cfg(test)]
mod tests;

pub use parameters::ElasticRefinerParameters;

use gridweave_runtime::stage::StageKind;
use stage::ElasticRefiner;

/// The stage kind `elastic_refiner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "elastic_refiner",
        "Deforms the maps of all placed robots, so that walls that several have seen are aligned; maps stay rigid where \
         that is likelier. It sends for each robot a lattice of small displacements and turns with their covariances, and the \
         sharpness of its walls; the rigid frames stay as they are. Deformations are estimated when other robots are placed, when a \
         frame has changed by more than `min_move` or `min_turn` or a map has grown by more than `min_growth`. Where only few maps \
         are new, these are first aligned with the others, which stay as they are until more are new. At the end all are estimated \
         from scratch, if that was not done before.",
        |parameters: ElasticRefinerParameters, _| Ok(ElasticRefiner::new(parameters)),
    )
    .input("map", "The robots' maps.", ElasticRefiner::receive_map)
    .input("frames", "The poses of the maps.", ElasticRefiner::receive_frames)
    .finish(ElasticRefiner::finish)
    .build()
}

//! Non-rigid refinement: deforms the maps of robots that are placed in one world, so that walls that several have
//! seen are aligned. The maps of a SLAM are right in every room and deformed as a whole.
//!
//! Each map gets a lattice of nodes ([`Deformation`](crate::shared::deformation::Deformation)). All nodes of all maps
//! are estimated together, as the least squares of
//!
//! - walls: a point of a wall of one map is on the same face of a wall of another, measured across that wall, with a
//!   Geman-McClure kernel that narrows from round to round (graduated non-convexity, Yang et al. 2020);
//! - drift: neighbouring nodes of a map are displaced and turned alike, as far as the drift of a SLAM allows, a
//!   random walk: the variance grows with the distance. Where only one map is known, this extrapolates the deformation,
//!   and the map is locally rigid;
//! - frames: a wide prior keeps the maps near their rigid frames.
//!
//! Where most maps were deformed before, the new ones are first aligned with these as they are, and the last rounds
//! estimate all together.
//!
//! Maps stay rigid where that is likelier than a deformation: where the noise of cells explains the walls as well.
//!
//! Nodes that are rigid pieces connected by drift are the submaps of Atlas (Bosse et al. 2004) and Cartographer (Hess
//! et al. 2016), on a lattice as in Kimera-Multi's deformation graphs (Tian et al. 2022) and in the embedded
//! deformation (Sumner et al. 2007). The alignment of all walls at once, and not region by region, is the
//! optimisation of Shahbandi, Magnusson and Iagnemma (2018), with points and lines in place of a distance map's
//! gradient.

mod anchor;
mod body;
mod contacts;
mod drift;
mod equations;
mod evidence;
mod parameters;
mod refine;
mod rounds;
mod sharpness;
mod stage;
#[cfg(test)]
mod tests;

pub use body::Body;
pub use drift::Drift;
pub use parameters::ElasticRefinerParameters;
pub use refine::{RefinedMap, Refinement, deform_onto, refine};
pub use sharpness::sharpness;

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
         are new, these are first aligned with the others. At the end all are estimated from scratch, if that was not done before.",
        |parameters: ElasticRefinerParameters, _| Ok(ElasticRefiner::new(parameters)),
    )
    .input("map", "The robots' maps.", ElasticRefiner::receive_map)
    .input("frames", "The poses of the maps.", ElasticRefiner::receive_frames)
    .finish(ElasticRefiner::finish)
    .build()
}

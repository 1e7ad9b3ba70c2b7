//! Aligns maps by random walks: Carpin, Birk and Jucikas, "On map merging", Robotics and Autonomous Systems 53
//! (2005), and Birk and Carpin, "Merging occupancy grid maps from multiple robots", Proceedings of the IEEE 94
//! (2006).
//!
//! The dissimilarity psi is minimised: the mean distance from a cell of one map to the nearest one of the same class
//! in the other, in both directions. Unlike a count of cells it falls smoothly towards the pose at which the maps
//! agree.
//!
//! - [`DistanceMap`]: distance from any cell to a class of cells, in two sweeps.
//! - [`dissimilarity`]: psi at a relative pose.
//! - [`walk`]: the adaptive random walk.
//! - [`align_by_walks`]: several walks from rotations all round, and their results.
//!
//! The papers let one walk run until it is stopped, and psi use all cells. Here there are several shorter walks with
//! bounds, over cells that are evenly sampled, in cells wider than those of the maps; the covariance is the spread of
//! the last accepted moves, which is the resolution of the walk at its end, and no measure of whether the pose is
//! right.
//!
//! There is no verification but the acceptance index, and psi favours poses with a large overlap: robots that share
//! little are aligned wrongly, and if such maps agree by chance, they are merged so.

mod align;
mod dissimilarity;
mod distance_map;
mod parameters;
#[cfg(test)]
mod tests;
mod walk;

pub use align::align_by_walks;
pub use dissimilarity::{ClassifiedMap, dissimilarity};
pub use distance_map::DistanceMap;
pub use parameters::RandomWalkParameters;
pub use walk::{WalkEnd, walk};

use crate::pair_aligner::{Criterion, Method, PairAligner, RatedPose};
use gridweave_runtime::stage::StageKind;
use gridweave_stages::registration::search::{NamedMap, SearchRefusal};

/// The stage kind `random_walk_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "random_walk_aligner",
        "Aligns the maps of each pair of robots by random walks, after Carpin and Birk (2005, 2006): they minimise the distances \
         from the cells of each map to those of the same class in the other. The pose with the best acceptance index \
         omega is taken if that is high enough; nothing else is checked, so maps that agree at a wrong pose are merged \
         wrongly.",
        |parameters: RandomWalkParameters, context| Ok(PairAligner::new(RandomWalk { parameters, seed: context.seed })),
    )
    .input("map", "The robots' maps.", PairAligner::receive_map)
    .finish(PairAligner::finish)
    .build()
}

/// The method, with the seed of the stage: every pair is walked with the same, so that it does not matter which others
/// there are.
struct RandomWalk {
    parameters: RandomWalkParameters,
    seed: u64,
}

impl Method for RandomWalk {
    const NAME: &'static str = "random_walk";

    fn align(&self, a: &NamedMap<'_>, b: &NamedMap<'_>) -> Result<Vec<RatedPose>, SearchRefusal> {
        align_by_walks(a, b, &self.parameters, self.seed)
    }

    fn criterion(&self) -> Criterion {
        Criterion { min_omega: self.parameters.min_omega, min_overlap: self.parameters.min_overlap }
    }

    fn max_hypotheses(&self) -> usize {
        self.parameters.max_hypotheses
    }
}

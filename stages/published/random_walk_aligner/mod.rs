//! Lays maps on each other by random walks: Carpin, Birk and Jucikas, "On map merging", Robotics and Autonomous Systems 53
//! (2005), and Birk and Carpin, "Merging occupancy grid maps from multiple robots", Proceedings of the IEEE 94 (2006).
//!
//! What is minimised is the dissimilarity psi: how far it is, in the mean, from a cell of one map to the nearest one of the
//! same class in the other, both ways. Other than a count of cells it falls smoothly towards the place where the maps agree.
//!
//! - [`DistanceMap`]: how far it is from anywhere to a class of cells, in two sweeps.
//! - [`dissimilarity`]: psi at a place.
//! - [`walk`]: the adaptive random walk.
//! - [`align_by_walks`]: several walks from rotations all round, and what they came to.
//!
//! The papers let one walk run until it is stopped, and psi take all cells. Here there are several shorter walks with bounds
//! of their own, over cells that are chosen evenly, in cells wider than those of the maps; the covariance is the spread of
//! the last accepted moves, which says how fine the walk was when it ended, and nothing of whether the place is the right one.
//!
//! There is no verification but the acceptance index, and psi draws maps to where they overlap most: robots that share
//! little are laid wrongly on each other, and where such maps agree by chance, they are merged so.

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

use crate::published::pair_aligner::{Criterion, Hypothesis, Method, PairAligner};
use crate::registration::search::{NamedMap, SearchRefusal};
use gridweave_runtime::stage::StageKind;

/// The stage kind `random_walk_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "random_walk_aligner",
        "Lays the maps of each pair of robots on each other by random walks, after Carpin and Birk (2005, 2006): they go to where \
         the cells of each map are nearest to those of the same class in the other. The place with the best acceptance index \
         omega is taken if that is high enough; nothing else is checked, so that maps which agree at a wrong place are merged \
         wrongly.",
        |parameters: RandomWalkParameters, context| Ok(PairAligner::new(RandomWalk { parameters, seed: context.seed })),
    )
    .input("map", "The robots' maps.", PairAligner::receive_map)
    .finish(PairAligner::finish)
    .build()
}

/// The method, with the seed of the stage: every pair is walked with the same, so that it does not matter which others there are.
struct RandomWalk {
    parameters: RandomWalkParameters,
    seed: u64,
}

impl Method for RandomWalk {
    const NAME: &'static str = "random_walk";

    fn align(&self, a: &NamedMap<'_>, b: &NamedMap<'_>) -> Result<Vec<Hypothesis>, SearchRefusal> {
        align_by_walks(a, b, &self.parameters, self.seed)
    }

    fn criterion(&self) -> Criterion {
        Criterion { min_omega: self.parameters.min_omega, min_overlap: self.parameters.min_overlap }
    }

    fn max_hypotheses(&self) -> usize {
        self.parameters.max_hypotheses
    }
}

//! Lays topological maps on each other: how two maps lie to each other, from their places and ways alone.
//!
//! Wang, Wang, Liu and Zheng, "An efficient method of multi-robots topological map building". A topological map is a set of
//! nodes and of straight paths between them:
//!
//! - [`Topology`]: nodes and paths as points and pairs of numbers.
//! - [`coinciding`]: the paths that lie on each other (equations 2 and 3).
//! - [`exhaustive`]: every node of one map on every node of the other, at every turn.
//! - [`icp_svd`]: iterative closest points on the nodes (steps 1 to 4, equations 4 to 6), from one start or several.
//! - [`Place`]: where it has been found that the maps may lie, made exact on the paths that coincide.
//! - [`judge`]: whether the best place is used.
//!
//! The published methods have no verification of their own: one takes the place with the most paths on paths, the other the
//! optimum that it ends in, however bad. Maps of buildings that have nothing in common always have some place where paths
//! coincide, and buildings repeat themselves. What [`judge`] asks for is ours. It knows of paths only, not of walls, and can
//! still be wrong: where it matters, the ranked places go through `icp_refiner` and `merge_verifier`.

mod exhaustive;
mod icp_svd;
mod judge;
mod parameters;
mod place;
mod similarity;
mod stage;
mod topology;

#[cfg(test)]
mod tests;

pub use exhaustive::{Exhaustive, exhaustive};
pub use icp_svd::{IcpSvd, icp_svd, icp_svd_from};
pub use judge::{Judgement, judge};
pub use parameters::{MatchingMethod, TopologyMatcherParameters};
pub use place::{Place, distinct};
pub use similarity::{PathPair, coinciding};
pub use topology::Topology;

use gridweave_runtime::stage::StageKind;
use stage::TopologyMatcher;

/// The stage kind `topology_matcher`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "topology_matcher",
        "Finds how the topological maps of each pair of robots lie to each other, by laying paths on paths. The published methods \
         have no verification of their own, and can merge wrongly; what is accepted here must have enough paths on paths, and \
         clearly more than at any other place.",
        |parameters: TopologyMatcherParameters, _| Ok(TopologyMatcher::new(parameters)),
    )
    .input("topology", "The robots' topological maps.", TopologyMatcher::receive_topology)
    .build()
}

//! Estimates the relative pose of two topological maps, from their nodes and paths only.
//!
//! Wang, Wang, Liu and Zheng, "An efficient method of multi-robots topological map building". A topological map is a
//! set of nodes and of straight paths between them:
//!
//! - [`Topology`]: nodes and paths as points and pairs of numbers.
//! - [`coinciding`]: the paths that coincide (equations 2 and 3).
//! - [`exhaustive`]: every node of one map on every node of the other, at every turn.
//! - [`icp_svd`]: iterative closest points on the nodes (steps 1 to 4, equations 4 to 6), from one start or several.
//! - [`MatchedPose`]: a relative pose, refined on the paths that coincide.
//! - [`judge`]: whether the best pose is used.
//!
//! The published methods have no verification: one takes the pose with most coinciding paths, the other the optimum
//! that it converges to, however bad. Maps of unrelated buildings always have some pose at which paths coincide, and
//! buildings repeat themselves. The criteria of [`judge`] are not from the paper. They use paths only, not walls, and
//! can be wrong: where it matters, the ranked poses go through `icp_refiner` and `merge_verifier`.

mod candidates;
mod exhaustive;
mod icp_svd;
mod judge;
mod matched_pose;
mod parameters;
mod similarity;
mod stage;
mod topology;

#[cfg(test)]
mod tests;

pub use exhaustive::{Exhaustive, TooDense, exhaustive};
pub use icp_svd::{IcpSvd, icp_svd, icp_svd_from};
pub use judge::{PoseJudgement, judge};
pub use matched_pose::{MatchedPose, distinct};
pub use parameters::{MatchingMethod, TopologyMatcherParameters};
pub use similarity::{PathPair, coinciding};
pub use topology::Topology;

use gridweave_runtime::stage::StageKind;
use stage::TopologyMatcher;

/// The stage kind `topology_matcher`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "topology_matcher",
        "Estimates the relative pose of the topological maps of each pair of robots, by the paths that coincide. The published \
         methods have no verification, and can merge wrongly; an accepted pose must have enough coinciding paths, and clearly \
         more than any other.",
        |parameters: TopologyMatcherParameters, _| Ok(TopologyMatcher::new(parameters)),
    )
    .input("topology", "The robots' topological maps.", TopologyMatcher::receive_topology)
    .build()
}

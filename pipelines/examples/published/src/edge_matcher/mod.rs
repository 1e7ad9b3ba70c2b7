//! Finds the translation between two maps of known rotation by the edges of their topological maps.
//!
//! From Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a topological approach to map merging for multiple
//! robots" (IEEE Robotics and Automation Magazine, June 2014), the blocks "Edge Matching" and "Translation
//! Uncertainty" of Figure 3: once map b is turned as map a, similar edges of both graphs are paired, and each pair
//! votes for the translation that aligns them. Right pairs agree, and wrong ones are scattered.
//!
//! What the paper leaves open, and how it is decided here:
//! - **Which edges are similar**: those of about the same length, whose ends are of the same degrees (a dead end, or
//!   a junction), and of the same shape: with both centroids aligned, points at the same shares of their lengths are
//!   near each other. An edge has no direction, so both are tried.
//! - **Weight of a pair**: the length of the shorter edge times both probabilities, so that long edges in well-known
//!   areas decide.
//! - **The translation** is that with most votes: the sum of the votes within `vote_radius`, and then their weighted
//!   mean. An accumulator of cells would split votes at its borders.
//! - **Its covariance** is the spread of these votes, with that of a single vote added, as a few votes can agree by
//!   chance. The rotation's variance turns map b about the centroid of the matched edges, which correlates rotation and
//!   translation.
//! - **When it is accepted**: at least `min_edges` edges of each map vote for it, and the second-best translation has
//!   no more than the share `max_runner_up` of its votes. The paper states no such test.
//!
//! The published method has no verification, and none is added here beyond the vote: nothing checks whether the walls
//! of the maps are aligned, or whether free space contradicts walls. Buildings with similar corridors can be merged
//! wrongly, and so can maps whose rotation is wrong by a quarter turn. It is here for comparison; where a merge
//! matters, use `map_merge`.
//!
//! - [`Edge`]: a path of a topological map with its features.
//! - [`votes`]: the pairs of similar edges.
//! - [`Election`]: the best and the second-best translation.
//! - [`match_edges`]: all of it.

mod edge;
mod election;
mod matching;
mod parameters;
mod refusal;
mod stage;
#[cfg(test)]
mod tests;
mod vote;

pub use edge::{Edge, edges};
pub use election::Election;
pub use matching::{EdgeMatch, match_edges};
pub use parameters::EdgeMatcherParameters;
pub use refusal::MatchRefusal;
pub use vote::{Vote, votes};

use gridweave_runtime::stage::StageKind;
use stage::EdgeMatcher;

/// The stage kind `edge_matcher`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "edge_matcher",
        "Finds the translation between the maps of each pair of robots whose rotation is known, by the edges of their topological \
         maps: edges that are alike vote for the translation that lays one on the other (Saeedi et al., \"Group mapping\"). \
         The spread of the votes is the translation's covariance. Nothing but the votes is verified.",
        |parameters: EdgeMatcherParameters, _| Ok(EdgeMatcher::new(parameters)),
    )
    .input("topological_map", "The robots' topological maps.", EdgeMatcher::receive_map)
    .input(
        "alignment",
        "An alignment for each pair of robots, of which the rotation and its variance are taken, and nothing else.",
        EdgeMatcher::receive_alignment,
    )
    .finish(EdgeMatcher::finish)
    .build()
}

//! Finds the translation between two maps of known rotation by the edges of their topological maps.
//!
//! From Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a topological approach to map merging for multiple robots" (IEEE
//! Robotics and Automation Magazine, June 2014), the blocks "Edge Matching" and "Translation Uncertainty" of Figure 3:
//! once map b is turned as map a, edges of both graphs that are alike are paired, and each pair says which translation lays
//! one on the other. Pairs that are right say the same, and others say anything.
//!
//! What the paper leaves open, and how it is decided here:
//! - **Which edges are alike**: those of about the same length, whose ends are of the same degrees (a dead end, or a junction),
//!   and of the same shape: with both middles laid on each other, points at the same shares of their lengths lie near each
//!   other. An edge has no direction, so that both are tried.
//! - **What a pair counts**: the length of the shorter edge times both probabilities, so that long edges in well-known areas
//!   decide.
//! - **The translation** is that at which most votes lie together: the sum of the votes within `vote_radius`, and then their
//!   weighted mean. An accumulator of cells would split votes at its borders.
//! - **Its covariance** is the spread of these votes, with that of a single vote added, as a few votes can agree by chance. The
//!   rotation's variance turns map b about the middle of the edges that were matched, which ties rotation and translation.
//! - **When it is accepted**: at least `min_edges` edges of each map take part, and the best translation elsewhere gathers no
//!   more than the share `max_runner_up` of its votes. The paper states no such test.
//!
//! The published method has no verification of its own, and none is added here beyond the vote: nothing asks whether the walls
//! of the maps lie on each other, or whether free space contradicts walls. Buildings whose corridors are alike can be merged
//! wrongly, and so can maps whose rotation was taken wrongly by a quarter turn. It is here for comparison; where a merge
//! matters, take `map_merge`.
//!
//! - [`Edge`]: a path of a topological map with what it is compared by.
//! - [`votes`]: the pairs of edges that are alike.
//! - [`Election`]: where most votes lie together, and where else.
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

//! Says which of the alignments of two maps that anything has proposed is right, if any, and why.
//!
//! Walls of one map on walls of the other speak for an alignment, and walls on known free space against it: Birk and
//! Carpin, "Merging occupancy grid maps from multiple robots" (Proceedings of the IEEE 2006).
//!
//! - [`compare`]: what two maps say of each other at one alignment.
//! - [`BentPlace`]: the same if the maps are bent, where they contradict each other as they came.
//! - [`best_rival_nearby`]: where else they fit, for alignments of which nobody has looked for others.
//! - [`Alias`]: where else map b may lie because the building looks alike there, as each map tells by itself.
//! - [`judge`]: all hypotheses for a pair against each other; [`Refusal`] says why none is accepted.
//! - [`Odds`]: how probable it is that an alignment is right.

mod agreement;
mod aliasing;
mod bending;
mod crossings;
mod found_by_walls;
mod judge;
mod knowledge;
mod parameters;
mod refusal;
mod regions;
mod rivals;
mod score;
mod self_similarities;
mod stage;
mod straight_walls;
mod verdict;

#[cfg(test)]
mod score_tests;
#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod tests;

pub use agreement::{Agreement, MapView, compare, compare_sampled};
pub use aliasing::{Alias, SelfSimilarity};
pub use bending::BentPlace;
pub use judge::{UserKnowledge, judge};
pub use parameters::MergeVerifierParameters;
pub use refusal::{Hypotheses, Hypothesis, Refusal};
pub use rivals::{Rival, best_rival_nearby};
pub use score::{Grounds, Odds, Origin};
pub use verdict::{Candidate, Verdict};

use gridweave_runtime::stage::StageKind;
use stage::MergeVerifier;

/// The stage kind `merge_verifier`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "merge_verifier",
        "Judges all alignments that were proposed for each pair of robots, from tags and from maps, against each other and \
         by the maps: how probable is it that walls lie on walls, and not on free space, for another reason than that it \
         is the place? It accepts one or none, from a probability on, and says why.",
        |parameters: MergeVerifierParameters, context| Ok(MergeVerifier::new(parameters, context)),
    )
    .input("map", "The robots' maps.", MergeVerifier::receive_map)
    .inputs(
        "alignment",
        "Refined alignments, one or several ranked ones for each pair of robots and source.",
        MergeVerifier::receive_alignment,
    )
    .finish(MergeVerifier::finish)
    .build()
}

//! Judges all hypotheses of the relative pose of each pair of robots, and accepts one or none: the stage of
//! [`registration::judgement`](crate::registration::judgement).

mod knowledge;
mod map_searches;
mod messages;
mod numbered_map;
mod self_similarities;
mod stage;

#[cfg(test)]
mod stage_tests;

use crate::registration::judgement::JudgementParameters;
use gridweave_runtime::stage::StageKind;
use stage::MergeVerifier;

/// The stage kind `merge_verifier`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "merge_verifier",
        "Judges all hypotheses of each pair of robots, from tags and from maps, against each other: the evidence of the \
         maps gives each a probability of being right. The most probable one is accepted if its probability is at least \
         `accept`, else none; with the reason.",
        |parameters: JudgementParameters, context| Ok(MergeVerifier::new(parameters, context)),
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

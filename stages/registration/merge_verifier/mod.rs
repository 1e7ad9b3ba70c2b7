//! Judges all hypotheses of how the maps of each pair of robots lie to each other, and accepts one or none: the stage round
//! [`registration::judgement`](crate::registration::judgement).

mod knowledge;
mod place_searches;
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
        "Judges all alignments that were proposed for each pair of robots, from tags and from maps, against each other and \
         by the maps: how probable is it that walls lie on walls, and not on free space, for another reason than that it \
         is the place? It accepts one or none, from a probability on, and says why.",
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

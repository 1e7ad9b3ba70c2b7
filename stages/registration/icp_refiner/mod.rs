//! Refines hypotheses by ICP: the stage round [`registration::icp`](crate::registration::icp).

mod stage;

#[cfg(test)]
mod stage_tests;

use crate::registration::icp::IcpParameters;
use gridweave_runtime::stage::StageKind;
use stage::IcpRefiner;

/// The stage kind `icp_refiner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "icp_refiner",
        "Refines first guesses of the relative pose of two maps by ICP on their walls. A guess is refused, with the \
         reason, if ICP does not converge, if the walls do not constrain the position or the rotation, and if the result is \
         far from the guess. merge_verifier judges whether the maps agree at the others.",
        |parameters: IcpParameters, _| Ok(IcpRefiner::new(parameters)),
    )
    .input("map", "The robots' maps.", IcpRefiner::receive_map)
    .inputs(
        "alignment",
        "First guesses, one or several ranked ones for each pair of robots.",
        IcpRefiner::receive_alignment,
    )
    .finish(IcpRefiner::finish)
    .build()
}

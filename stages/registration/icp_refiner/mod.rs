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
        "Refines first guesses of how two maps lie to each other by ICP on their walls. A guess is refused, with the \
         reason, where ICP does not settle, where the walls leave the place or the rotation open, and where they fit only \
         far from the guess. merge_verifier says of the others whether the maps agree there.",
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

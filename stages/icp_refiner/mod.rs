//! Refines the alignment of two maps by ICP on their walls (Tsardoulias et al., section 4.3).
//!
//! [`register`] moves map b until its walls lie on those of map a, where they lie near each other; [`IcpRefusal`] says why
//! the outcome may not be used. [`refine`] does both. Whether the maps agree there is for `merge_verifier` to say.

mod first_guess;
mod iteration;
mod normal_equations;
mod parameters;
mod refine;
mod refusal;
mod registration;
mod stage;

#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod tests;

pub use first_guess::FirstGuess;
pub use parameters::{IcpParameters, Metric, Weighting};
pub use refine::{Refinement, refine};
pub use refusal::IcpRefusal;
pub(crate) use registration::approach;
pub use registration::{Registration, register};

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

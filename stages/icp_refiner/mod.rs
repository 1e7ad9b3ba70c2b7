//! Refines the alignment of two maps by ICP on their walls (Tsardoulias et al., section 4.3).
//!
//! [`WallMap`] turns a map's occupied cells into wall points with normals, once for each map. [`register`] moves map b
//! until its walls lie on those of map a, where they lie near each other; [`Refusal`] says why the outcome may not be
//! used. [`refine`] does both. Whether the maps agree there is for `merge_verifier` to say.

mod first_guess;
mod iteration;
mod normal_equations;
mod parameters;
mod point_index;
mod refine;
mod refusal;
mod registration;
mod stage;
mod wall_map;

#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod tests;

pub use first_guess::FirstGuess;
pub use parameters::{IcpParameters, Metric, Weighting};
pub use point_index::{Neighbour, PointIndex};
pub use refine::{Refinement, refine};
pub use refusal::Refusal;
pub use registration::{Registration, register};
pub(crate) use registration::{approach, stride};
pub use wall_map::{KnownSample, WallMap};

use gridweave_runtime::ros::{Alignment, OccupancyGrid};
use gridweave_runtime::stage::{InputPort, OutputPort, PortType, StageKind};

/// The stage kind `icp_refiner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "icp_refiner",
        "Refines first guesses of how two maps lie to each other by ICP on their walls. A guess is refused, with the \
         reason, where ICP does not settle, where the walls leave the place or the rotation open, and where they fit only \
         far from the guess. merge_verifier says of the others whether the maps agree there.",
        vec![
            InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "The robots' maps."),
            InputPort::many(
                "alignment",
                PortType::of::<Alignment>(),
                "First guesses, one or several ranked ones for each pair of robots.",
            ),
        ],
        vec![OutputPort::new(
            "alignment",
            PortType::of::<Alignment>(),
            "The refined alignments, ranked as before, each settled or refused.",
        )],
        |parameters: IcpParameters, _context| Ok(stage::IcpRefiner::new(parameters)),
    )
}

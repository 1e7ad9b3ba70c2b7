//! Refines the alignment of two maps by ICP on their walls, and verifies the result (Tsardoulias et al., section 4.3).
//!
//! [`WallMap`] turns a map's occupied cells into wall points with normals, once for each map. [`register`] moves map b
//! until its walls lie on those of map a, where they lie near each other. [`compare`] then counts on how much wall the
//! maps agree, and how much wall of one map lies on the other's free space; [`Refusal`] says why an alignment may not
//! be used. [`refine`] does all three. [`refine_provisional`] asks for more, where the first guess rests on too little to be
//! believed by itself, and [`best_rival`] tells it whether the maps fit elsewhere nearly as well.

mod first_guess;
mod iteration;
mod normal_equations;
mod parameters;
mod point_index;
mod refine;
mod refusal;
mod registration;
mod rivals;
mod stage;
mod verify;
mod wall_map;

#[cfg(test)]
pub(crate) mod floor_plan;
#[cfg(test)]
mod stage_tests;
#[cfg(test)]
mod tests;

pub use first_guess::FirstGuess;
pub use parameters::{IcpParameters, Metric, Weighting};
pub use point_index::{Neighbour, PointIndex};
pub use refine::{Refinement, refine, refine_provisional};
pub use refusal::Refusal;
pub use registration::{Registration, register};
pub use rivals::{Rival, best_rival};
pub use verify::{Agreement, MapView, compare};
pub use wall_map::{KnownSample, WallMap};

use gridweave_runtime::ros::{Alignment, OccupancyGrid};
use gridweave_runtime::stage::{InputPort, OutputPort, PortType, StageKind};

/// The stage kind `icp_refiner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "icp_refiner",
        "Refines the first guess of how two maps lie to each other by ICP on their walls, and verifies the result: it \
         is accepted only where walls lie on walls, and refused with the reason otherwise. A provisional first guess, such \
         as one that rests on two tags, must meet more, and is confirmed if it does.",
        vec![
            InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "The robots' maps."),
            InputPort::one("alignment", PortType::of::<Alignment>(), "First guesses, one for each pair of robots."),
        ],
        vec![OutputPort::new("alignment", PortType::of::<Alignment>(), "The refined alignments, accepted or refused.")],
        |parameters: IcpParameters, _context| Ok(stage::IcpRefiner::new(parameters)),
    )
}

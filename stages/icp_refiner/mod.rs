//! Refines the alignment of two maps by ICP on their walls, and verifies the result.

mod first_guess;
mod iteration;
mod normal_equations;
mod parameters;
mod point_index;
mod registration;
mod verify;
mod wall_map;

pub use first_guess::FirstGuess;
pub use parameters::{IcpParameters, Metric, Weighting};
pub use point_index::{Neighbour, PointIndex};
pub use registration::{Registration, register};
pub use verify::{Agreement, MapView, compare};
pub use wall_map::{KnownSample, WallMap};

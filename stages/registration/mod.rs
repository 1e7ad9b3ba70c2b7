//! The relative pose of two maps, and the probability that it is right.
//!
//! Two maps are registered in four steps, each a room of its own:
//!
//! 1. [`search`]: all poses of map b on map a are tried, and the peaks become hypotheses.
//! 2. [`icp`]: each hypothesis is refined until the walls lie on each other.
//! 3. [`comparison`]: the walls of each map are looked up in the other, as they came and deformed.
//! 4. [`judgement`]: one sum of evidence for each hypothesis, and one probability for each over all of them.
//!
//! [`register`] does all four for a [`PreparedPair`] of maps. The stages [`map_aligner`], [`icp_refiner`] and
//! [`merge_verifier`] do a step each, so that other methods can propose hypotheses, too.

pub mod comparison;
pub mod hypotheses;
mod hypothesis;
pub mod icp;
pub mod icp_refiner;
pub mod judgement;
pub mod map_aligner;
pub mod merge_verifier;
pub mod place_window;
mod register;
pub mod search;

use gridweave_runtime::stage::StageKind;

pub use hypothesis::{Basis, Hypothesis};
pub use register::{PreparedPair, RegistrationParameters, register};

/// The stage kinds of this room.
pub fn kinds() -> Vec<StageKind> {
    vec![icp_refiner::kind(), map_aligner::kind(), merge_verifier::kind()]
}

//! The relative pose of two maps, and the probability that it is right.
//!
//! Two maps are registered in four steps, each in a module of its own:
//!
//! 1. [`search`]: all poses of map b on map a are scored, and the peaks become hypotheses.
//! 2. [`icp`]: each hypothesis is refined by aligning the walls.
//! 3. [`comparison`]: the walls of each map are looked up in the other, as they came and deformed.
//! 4. [`judgement`]: the evidence for each hypothesis is summed, and all of them together give one probability for
//!    each.
//!
//! [`non_rigid`] deforms maps, for the comparison and for the merge.
//!
//! [`register`] does all four for a [`PreparedPair`] of maps. The stages [`map_aligner`], [`icp_refiner`] and
//! [`merge_verifier`] do one step each, so that other methods can propose hypotheses, too.

pub mod comparison;
pub mod hypotheses;
mod hypothesis;
pub mod icp;
pub mod icp_refiner;
pub mod judgement;
pub mod map_aligner;
pub mod merge_verifier;
pub mod non_rigid;
pub mod pose_window;
mod register;
mod scale;
pub mod search;

#[cfg(test)]
mod drawn_map;

use gridweave_runtime::stage::StageKind;

pub use hypothesis::{Basis, Hypothesis};
pub use register::{PreparedPair, RegistrationParameters, register};
pub use scale::Scale;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![icp_refiner::kind(), map_aligner::kind(), merge_verifier::kind()]
}

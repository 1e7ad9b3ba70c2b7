//! The stages of Gridweave, one module for each step of a merge:
//!
//! 1. [`mapping`]: the map of one robot, from its scans or as it published it;
//! 2. [`tags`] and [`topology`]: hypotheses of the relative pose of two maps, from tags and from topological maps;
//! 3. [`registration`]: hypotheses from the maps alone, their refinement, and the judgement of all;
//! 4. [`merge`]: one pose for each robot, and one map.
//!
//! [`simulator`] and [`python_stage`] are stages of their own, and [`shared`] is what the modules have in common. A stage
//! is a folder: the algorithm as plain functions on slices and nalgebra types, and beside it `stage.rs`, the thin
//! adapter that turns messages into calls.

#![forbid(unsafe_code)]

pub mod mapping;
pub mod merge;
pub mod python_stage;
pub mod registration;
pub mod shared;
pub mod simulator;
pub mod tags;
pub mod topology;

use gridweave_runtime::stage::StageKind;

/// All stage kinds of this crate, by name.
pub fn kinds() -> Vec<StageKind> {
    let mut kinds = vec![python_stage::kind(), simulator::kind()];
    kinds.extend(mapping::kinds());
    kinds.extend(merge::kinds());
    kinds.extend(registration::kinds());
    kinds.extend(tags::kinds());
    kinds.extend(topology::kinds());
    kinds.sort_by_key(|kind| kind.name);
    kinds
}

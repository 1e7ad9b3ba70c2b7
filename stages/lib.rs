//! The stages of Gridweave, a folder each: the algorithm as plain functions on slices and nalgebra types, and beside
//! it `stage.rs`, the thin adapter that turns messages into calls.

#![forbid(unsafe_code)]

pub mod geometry;
pub mod line_extractor;
pub mod quadrant_classifier;

use gridweave_runtime::stage::StageKind;

/// All stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![line_extractor::kind(), quadrant_classifier::kind()]
}

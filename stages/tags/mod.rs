//! Hypotheses from tags: where each robot has seen tags, which of them two robots have in common, and, from those and the
//! direction of the walls, a first estimate of the relative pose of two maps.

pub mod line_extractor;
pub mod quadrant_classifier;
pub mod tag_filter;
pub mod tag_localizer;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this room.
pub fn kinds() -> Vec<StageKind> {
    vec![line_extractor::kind(), quadrant_classifier::kind(), tag_filter::kind(), tag_localizer::kind()]
}

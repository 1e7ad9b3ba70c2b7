//! Hypotheses from tags: positions of tags in each robot's map, the tags that two robots have in common, and, from
//! those and the direction of the walls, a first guess of the relative pose of two maps.

pub mod line_extractor;
pub mod quadrant_classifier;
pub mod tag_filter;
pub mod tag_localizer;

use gridweave_runtime::stage::StageKind;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![line_extractor::kind(), quadrant_classifier::kind(), tag_filter::kind(), tag_localizer::kind()]
}

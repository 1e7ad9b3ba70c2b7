//! Topological maps: the skeleton of the free space, the graph of its nodes and paths, and hypotheses from matching
//! two graphs.

pub mod skeleton;
pub mod topology_extractor;
pub mod topology_matcher;

use gridweave_runtime::stage::StageKind;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![topology_extractor::kind(), topology_matcher::kind()]
}

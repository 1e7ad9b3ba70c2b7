//! Methods of other authors as published, for comparison and for use in pipelines.

pub mod acceptance_index;
pub mod edge_matcher;
pub mod entropy_fuser;
pub mod hough_spectrum_aligner;
pub mod pair_aligner;
pub mod pgvd_extractor;
pub mod radon_aligner;
pub mod random_walk_aligner;
pub mod uncertain_transform;

use gridweave_runtime::stage::StageKind;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![
        edge_matcher::kind(),
        entropy_fuser::kind(),
        hough_spectrum_aligner::kind(),
        pgvd_extractor::kind(),
        radon_aligner::kind(),
        random_walk_aligner::kind(),
        uncertain_transform::kind(),
    ]
}

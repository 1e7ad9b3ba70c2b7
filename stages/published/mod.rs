//! Methods of other authors as they published them, to compare with and to wire into pipelines of one's own.

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

/// The stage kinds of this room.
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

//! The stages of Gridweave, a folder each: the algorithm as plain functions on slices and nalgebra types, and beside
//! it `stage.rs`, the thin adapter that turns messages into calls. What several stages share is
//! in `geometry`, `walls`, `acceptance_index`, `deformation`, `hypotheses`, `log_odds`, `placement`, `robot_maps`, `robot_pair`,
//! `scan_grid` and `skeleton`.

#![forbid(unsafe_code)]

pub mod acceptance_index;
pub mod deformation;
pub mod edge_matcher;
pub mod elastic_refiner;
pub mod entropy_fuser;
pub mod frame_solver;
pub mod geometry;
pub mod grid_fuser;
pub mod hough_spectrum_aligner;
pub mod hypotheses;
pub mod icp_refiner;
pub mod line_extractor;
pub mod log_odds;
pub mod map_aligner;
pub mod map_cleaner;
pub mod map_placer;
pub mod map_selector;
pub mod marker_maker;
pub mod merge_verifier;
pub mod pair_aligner;
pub mod path_placer;
pub mod pgvd_extractor;
pub mod placement;
pub mod python_stage;
pub mod quadrant_classifier;
pub mod radon_aligner;
pub mod random_walk_aligner;
pub mod registration;
pub mod robot_maps;
pub mod robot_pair;
pub mod scan_grid;
pub mod scan_mapper;
pub mod simulator;
pub mod skeleton;
pub mod tag_filter;
pub mod tag_localizer;
#[cfg(test)]
mod test_world;
pub mod topology_extractor;
pub mod topology_matcher;
pub mod uncertain_transform;
pub mod walls;

use gridweave_runtime::stage::StageKind;

/// All stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![
        edge_matcher::kind(),
        elastic_refiner::kind(),
        entropy_fuser::kind(),
        frame_solver::kind(),
        grid_fuser::kind(),
        hough_spectrum_aligner::kind(),
        icp_refiner::kind(),
        line_extractor::kind(),
        map_aligner::kind(),
        map_cleaner::kind(),
        map_placer::kind(),
        map_selector::kind(),
        marker_maker::kind(),
        merge_verifier::kind(),
        path_placer::kind(),
        pgvd_extractor::kind(),
        python_stage::kind(),
        quadrant_classifier::kind(),
        radon_aligner::kind(),
        random_walk_aligner::kind(),
        scan_mapper::kind(),
        simulator::kind(),
        tag_filter::kind(),
        tag_localizer::kind(),
        topology_extractor::kind(),
        topology_matcher::kind(),
        uncertain_transform::kind(),
    ]
}

//! The stages of Gridweave, a folder each: the algorithm as plain functions on slices and nalgebra types, and beside
//! it `stage.rs`, the thin adapter that turns messages into calls. What several stages share is
//! in `geometry`, `walls`, `acceptance_index`, `deformation`, `hypotheses`, `placement`, `robot_maps` and `robot_pair`.

#![forbid(unsafe_code)]

pub mod acceptance_index;
pub mod deformation;
pub mod elastic_refiner;
pub mod frame_solver;
pub mod geometry;
pub mod grid_fuser;
pub mod hypotheses;
pub mod icp_refiner;
pub mod line_extractor;
pub mod map_aligner;
pub mod map_cleaner;
pub mod map_placer;
pub mod map_selector;
pub mod merge_verifier;
pub mod path_placer;
pub mod place_window;
pub mod placement;
pub mod quadrant_classifier;
pub mod robot_maps;
pub mod robot_pair;
pub mod simulator;
pub mod skeleton;
pub mod tag_filter;
pub mod tag_localizer;
#[cfg(test)]
mod test_world;
pub mod walls;

use gridweave_runtime::stage::StageKind;

/// All stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![
        elastic_refiner::kind(),
        frame_solver::kind(),
        grid_fuser::kind(),
        icp_refiner::kind(),
        line_extractor::kind(),
        map_aligner::kind(),
        map_cleaner::kind(),
        map_placer::kind(),
        map_selector::kind(),
        merge_verifier::kind(),
        path_placer::kind(),
        quadrant_classifier::kind(),
        simulator::kind(),
        tag_filter::kind(),
        tag_localizer::kind(),
    ]
}

//! From the accepted relative poses of pairs to one map: a pose for each robot, deformations, the fused grid, and the
//! paths and markers in its frame.

pub mod elastic_refiner;
pub mod frame_solver;
pub mod grid_fuser;
pub mod map_placer;
pub mod marker_maker;
pub mod path_placer;

use gridweave_runtime::stage::StageKind;

/// Stage kinds of this module.
pub fn kinds() -> Vec<StageKind> {
    vec![
        elastic_refiner::kind(),
        frame_solver::kind(),
        grid_fuser::kind(),
        map_placer::kind(),
        marker_maker::kind(),
        path_placer::kind(),
    ]
}

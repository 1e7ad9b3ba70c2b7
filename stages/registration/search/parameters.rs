//! Parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Parameters of the map aligner. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapAlignerParameters {
    /// Side of a cell in which poses are scored, metres; never less than 3 cells of the coarser map. The search takes
    /// cells twice as wide, and wider ones in large maps; its peaks are refined in cells half as wide.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cell: f64,
    /// Largest distance of the rotations at which poses are scored, radians. The search takes steps twice as wide,
    /// and narrower ones in large maps, so that their ends move by less than a cell.
    #[schemars(range(min = 1e-3, max = PI))]
    pub rotation_step: f64,
    /// Weight of a wall cell on known free space of the other map, against the pose, where a wall cell on a wall has
    /// a weight of 1. In cells hardly narrower than rooms, the search takes the greater weight at which a random pose
    /// scores 0 in the mean.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub free_space_penalty: f64,
    /// Two poses are distinct if they differ by a rotation of more than this, radians, or by `apart`.
    #[schemars(range(min = 0.0, max = PI))]
    pub apart_yaw: f64,
    /// Two poses are distinct if they differ by more than this at the centroid of the common walls, metres, or by
    /// `apart_yaw`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// Least inlier length, approximately, metres: with less there is too little evidence for `merge_verifier`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_wall_length: f64,
    /// Largest number of hypotheses for a pair of maps.
    #[schemars(range(min = 1))]
    pub max_hypotheses: usize,
    /// Hypotheses that score less than this share of the best are left out, except the second-best.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub least_share: f64,
    /// Maps are merged, to be searched as one, if the second-best pose scores at most this share of the best, 0 to 1.
    /// In maps of six buildings that were built from laser scans and of ten simulated ones, it scores 0.05 to 0.41 in
    /// pairs that belong together, and 0.63 to 1.0 in pairs that do not.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tie_second_best: f64,
    /// Least inlier length of maps that are merged, metres.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tie_wall_length: f64,
    /// Least inlier ratio of maps that are merged. Wrongly merged groups of simulated robots had 0.74 to 0.83.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tie_wall_agreement: f64,
    /// A pose that scores more than `tie_second_best` of the best, with an inlier ratio that is not less by more than
    /// this, shows a self-similar building. Then no two of the robots are aligned by this search.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub alike_margin: f64,
    /// A robot whose map fits on a merged map is aligned with at most this many of its robots, besides the one with
    /// the most wall in common.
    pub predictions: usize,
    /// A map whose known area has grown by at most this share since it was searched keeps its hypotheses, if they
    /// still fit, and is not searched again before the end.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub little_growth: f64,
    /// Whether hypotheses are marked as provisional: then `merge_verifier` must confirm them by more evidence than
    /// those from tags.
    pub provisional: bool,
    /// Longest known part of a map along x or y, metres; longer maps are refused, as time and memory grow with the
    /// square.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub max_extent: f64,
}

impl Default for MapAlignerParameters {
    fn default() -> Self {
        Self {
            cell: 0.2,
            rotation_step: TAU / 360.0,
            free_space_penalty: 1.2,
            apart_yaw: TAU / 36.0,
            apart: 1.0,
            min_wall_length: 4.0,
            max_hypotheses: 4,
            least_share: 0.5,
            tie_second_best: 0.5,
            tie_wall_length: 50.0,
            tie_wall_agreement: 0.9,
            alike_margin: 0.05,
            predictions: 2,
            little_growth: 0.2,
            provisional: true,
            max_extent: 400.0,
        }
    }
}

impl Parameters for MapAlignerParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        // Beyond that, tables of all poses do not fit in memory.
        let fits = self.max_extent / self.cell <= 1e4;
        (!fits).then(|| ParameterError::new("max_extent", "must be at most 10000 cells")).into_iter().collect()
    }
}

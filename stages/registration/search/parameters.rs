//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Parameters of the map aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapAlignerParameters {
    /// The side of a cell in which places are judged, metres; never less than 3 cells of the coarser map. The search for
    /// them takes cells twice as wide, and wider ones in large maps; the best of them are placed in cells half as wide.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cell: f64,
    /// The rotations at which places are judged lie at most this far apart, radians. The search for them takes steps
    /// twice as wide, and closer ones in large maps, whose ends would else come to lie beside their places.
    #[schemars(range(min = 1e-3, max = PI))]
    pub rotation_step: f64,
    /// How much a cell of wall that lies on known free space of the other map counts against a place, where a cell of
    /// wall on wall counts 1 for it. In
    /// the search in cells that are hardly narrower than rooms it counts as much more as it takes for chance to score nothing.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub free_space_penalty: f64,
    /// Another place differs from the best by a rotation of more than this, radians, or by `apart`.
    #[schemars(range(min = 0.0, max = PI))]
    pub apart_yaw: f64,
    /// Another place differs from the best by more than this in the middle of the walls in common, metres, or by
    /// `apart_yaw`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// About the least length of wall on which the maps must agree, metres: on less there is nothing to weigh for
    /// `merge_verifier`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_wall_length: f64,
    /// At most so many guesses are made for a pair of maps, each away from the others.
    #[schemars(range(min = 1))]
    pub max_hypotheses: usize,
    /// Guesses that score less than this share of the best are left out, but for the second.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub least_share: f64,
    /// Maps are laid together, to be searched as one, if the best place elsewhere scores at most this share of the best,
    /// 0 to 1. In maps of six buildings that were drawn from laser scans and of ten simulated ones, other places have 0.05
    /// to 0.41 in pairs that belong together, and 0.63 to 1.0 in pairs that do not.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tie_runner_up: f64,
    /// Nor are they laid together if they agree on less wall than this, metres.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tie_wall_length: f64,
    /// Nor if a smaller share than this of the walls agrees. What was laid together in a wrong place in teams of simulated robots
    /// had 0.74 to 0.83.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tie_wall_agreement: f64,
    /// Where another place scores more than `tie_runner_up` of the best, and the share of the walls that agree there is less by this
    /// only, or not at all, the building is alike in both, and no two of the robots are aligned for it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub alike_margin: f64,
    /// A robot that is laid on several maps that lie together is aligned with at most so many more of them, besides
    /// the one with which it has the most wall in common.
    pub predictions: usize,
    /// A map whose known area has grown by at most this share since it was searched keeps its guesses, if they still fit, and is
    /// not searched again before the end.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub little_growth: f64,
    /// Whether the guess is marked as provisional: then `merge_verifier` must confirm it by more than it asks of a guess
    /// that rests on tags.
    pub provisional: bool,
    /// A map whose known part is longer than this in x or in y is not aligned, metres: time and memory grow with the
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
            tie_runner_up: 0.5,
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
        // Beyond that, tables of all places do not fit in memory.
        let fits = self.max_extent / self.cell <= 1e4;
        (!fits).then(|| ParameterError::new("max_extent", "must be at most 10000 cells")).into_iter().collect()
    }
}

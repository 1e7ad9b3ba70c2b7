//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Parameters of the random walk aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RandomWalkParameters {
    /// The side of a cell in which distances are taken, metres; never less than one and a half cells of either map.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cell: f64,
    /// Largest number of cells of each class and map in the dissimilarity psi, evenly sampled.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub max_points: usize,
    /// Number of walks for each pair of maps, which begin at evenly spaced rotations, with the centres of the maps
    /// aligned.
    #[schemars(range(min = 1, max = 10_000))]
    pub walks: usize,
    /// Largest number of trials of a walk.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub max_trials: usize,
    /// Number of trials without an improvement after which a walk ends.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub patience: usize,
    /// The standard deviation of the first moves in x and in y, metres.
    #[schemars(range(min = 1e-3, max = 1e3))]
    pub first_move: f64,
    /// The standard deviation of the first turns, radians.
    #[schemars(range(min = 1e-3, max = PI))]
    pub first_turn: f64,
    /// Number of accepted moves whose mean and deviations are those of further moves; after as many refusals in a row
    /// the deviations are halved.
    #[schemars(range(min = 1, max = 10_000))]
    pub history: usize,
    /// The probability that a move is accepted which makes psi worse, so that a walk can leave a local minimum.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accept_worse: f64,
    /// Two poses are the same if the centre of the map is moved by less than this, metres, and it is turned by less
    /// than `apart_yaw`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// See `apart`, radians.
    #[schemars(range(min = 0.0, max = PI))]
    pub apart_yaw: f64,
    /// Least acceptance index omega of an accepted pose. In maps that were built from laser scans in six buildings,
    /// right poses had 0.97 and more, and those of different buildings up to 0.951; other maps, of mostly free space,
    /// have more at wrong poses.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_omega: f64,
    /// Least share of the smaller map at which the other must be known. The papers require none, and maps that share a
    /// few cells nearly always agree on them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_overlap: f64,
    /// Largest number of hypotheses that are sent for a pair of maps.
    #[schemars(range(min = 1, max = 1000))]
    pub max_hypotheses: usize,
    /// A map whose known part is longer than this in x or in y is not aligned, metres.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub max_extent: f64,
}

impl Default for RandomWalkParameters {
    fn default() -> Self {
        Self {
            cell: 0.1,
            max_points: 300,
            walks: 16,
            max_trials: 1500,
            patience: 300,
            first_move: 2.0,
            first_turn: 0.2,
            history: 20,
            accept_worse: 0.01,
            apart: 1.0,
            apart_yaw: PI / 18.0,
            min_omega: 0.96,
            min_overlap: 0.1,
            max_hypotheses: 4,
            max_extent: 400.0,
        }
    }
}

impl Parameters for RandomWalkParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        // Beyond that, tables of distances do not fit in memory.
        let fits = self.max_extent / self.cell <= 1e4;
        (!fits).then(|| ParameterError::new("max_extent", "must be at most 10000 cells")).into_iter().collect()
    }
}

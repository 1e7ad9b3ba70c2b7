//! The parameters of the stage.

use crate::shared::walls::NORMAL_RADIUS;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What registration measures between two points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// The distance of a point from the line of the wall nearest to it. Finds a place between the cells, and lets
    /// points slide along their wall.
    #[default]
    PointToLine,
    /// The distance of a point from the point nearest to it: the paper's.
    PointToPoint,
}

/// How much a point counts that lies far from its partner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Every pair counts the same: the paper's.
    None,
    /// Pairs farther apart than a third of the search distance count less, in inverse proportion.
    Huber,
    /// Pairs count less the farther they are apart; the farthest hardly at all.
    #[default]
    GemanMcclure,
}

/// Parameters of the ICP refiner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IcpParameters {
    /// What registration measures between two points: `point_to_line`, or `point_to_point` (the paper).
    pub metric: Metric,
    /// How much a pair counts by its distance: `geman_mcclure`, `huber`, or `none` (the paper).
    pub weighting: Weighting,
    /// How far from a wall point of map b its partner in map a may lie at first, metres. It bounds the error of the
    /// first guess that can be mended.
    pub max_distance: f64,
    /// How far the partner may lie in the end, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_distance: f64,
    /// The factor by which that distance shrinks with every iteration.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub shrink: f64,
    /// The most iterations at that last distance; by how far an alignment still moves then, its covariance is wider.
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// Registration has converged when an iteration moves the wall points by less than this, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub convergence: f64,
    /// The number of points that the iterations before the last distance make do with.
    #[schemars(range(min = 1))]
    pub coarse_points: usize,
    /// Where the first guess's rotation is vague, rotations this far apart are tried as starts, as far as two standard
    /// deviations to either side, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub start_spacing: f64,
    /// The radius in which a wall's direction is measured, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub normal_radius: f64,
    /// The length of wall that counts as one independent measurement, metres: the errors of cells that stand side by
    /// side are alike. It scales the covariance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub correlation_length: f64,
    /// Standard deviation of x and y of a first guess that brings no covariance, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub initial_position_deviation: f64,
    /// Standard deviation of the rotation of a first guess that brings no covariance, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub initial_yaw_deviation: f64,
    /// Added to the first guess's own uncertainty, as a standard deviation of x and y in the common section, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub position_slack: f64,
    /// Added to the first guess's own uncertainty, as a standard deviation of the rotation, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_slack: f64,
    /// How many standard deviations of the first guess the refined transform may lie away from it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_step: f64,
    /// The greatest standard deviation of the place of walls in the common section, in any direction and by the rotation, metres. An
    /// alignment that is known less well is refused, as a direction is open; any other comes with its covariance. A greater value
    /// merges along a bare corridor, with a covariance as long.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_deviation: f64,
    /// An accepted alignment is kept while the maps stay the same and the first guess moves by no more than this in the
    /// common section, metres.
    #[schemars(range(min = 0.0))]
    pub reuse_within: f64,
    /// An accepted alignment is kept while the maps stay the same and the first guess turns by no more than this,
    /// radians.
    #[schemars(range(min = 0.0))]
    pub reuse_within_yaw: f64,
}

impl Default for IcpParameters {
    fn default() -> Self {
        Self {
            metric: Metric::default(),
            weighting: Weighting::default(),
            max_distance: 1.0,
            min_distance: 0.15,
            shrink: 0.8,
            max_iterations: 100,
            convergence: 1e-4,
            coarse_points: 600,
            start_spacing: 0.05,
            normal_radius: NORMAL_RADIUS,
            correlation_length: 2.0,
            initial_position_deviation: 0.3,
            initial_yaw_deviation: 0.05,
            position_slack: 0.1,
            yaw_slack: 0.02,
            max_step: 5.0,
            max_deviation: 0.3,
            reuse_within: 0.05,
            reuse_within_yaw: 0.01,
        }
    }
}

impl Parameters for IcpParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let is_larger = self.max_distance >= self.min_distance;
        (!is_larger)
            .then(|| ParameterError::new("max_distance", "must be at least `min_distance`"))
            .into_iter()
            .collect()
    }
}

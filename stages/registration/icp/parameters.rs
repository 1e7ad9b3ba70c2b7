//! Parameters of the stage.

use crate::shared::walls::NORMAL_RADIUS;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The residual of a pair of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Distance of a point from the line of the nearest wall. It is accurate to a fraction of a cell, and lets points
    /// move along their wall.
    #[default]
    PointToLine,
    /// Distance of a point from the nearest point: as in the paper.
    PointToPoint,
}

/// Weight of a pair by its distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// All pairs count the same: as in the paper.
    None,
    /// Pairs farther apart than a third of the search distance count less, in inverse proportion.
    Huber,
    /// Pairs count less the farther they are apart; the farthest hardly at all.
    #[default]
    GemanMcclure,
}

/// Parameters of the ICP refiner. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IcpParameters {
    /// Residual of a pair of points: `point_to_line`, or `point_to_point` (the paper).
    pub metric: Metric,
    /// Weight of a pair by its distance: `geman_mcclure`, `huber`, or `none` (the paper).
    pub weighting: Weighting,
    /// Largest distance of a wall point of map b from its partner in map a in the first iteration, metres. It bounds
    /// the error of the first guess that can be corrected.
    pub max_distance: f64,
    /// Largest distance of the partner in the last iterations, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_distance: f64,
    /// Factor by which that distance shrinks with every iteration.
    #[schemars(range(max = 0.99), extend("exclusiveMinimum" = 0))]
    pub shrink: f64,
    /// Most iterations at that last distance. The covariance is widened by the motion of the last one.
    #[schemars(range(min = 1, max = 10_000))]
    pub max_iterations: usize,
    /// Registration has converged when an iteration moves the wall points by less than this, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub convergence: f64,
    /// Number of points in the iterations before the last distance.
    #[schemars(range(min = 1))]
    pub coarse_points: usize,
    /// Spacing of the rotations that are tried as starts where the first guess's rotation is uncertain, up to two
    /// standard deviations to either side, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub start_spacing: f64,
    /// Radius in which a wall's direction is estimated, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub normal_radius: f64,
    /// Length of wall that counts as one independent measurement, metres: neighbouring cells have correlated errors.
    /// It scales the covariance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub correlation_length: f64,
    /// Standard deviation of x and y of a first guess without a covariance, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub initial_position_deviation: f64,
    /// Standard deviation of the rotation of a first guess without a covariance, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub initial_yaw_deviation: f64,
    /// Standard deviation of x and y in the common section that is added to the first guess's own, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub position_slack: f64,
    /// Standard deviation of the rotation that is added to the first guess's own, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_slack: f64,
    /// Largest Mahalanobis distance of the refined transform from the first guess.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_step: f64,
    /// Largest standard deviation of walls in the common section, in any direction and by the rotation, metres. An
    /// alignment that is less certain is refused, as it is degenerate in a direction; any other is sent with its
    /// covariance. A greater value merges along a bare corridor, with a covariance as long.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_deviation: f64,
    /// An accepted alignment is reused while the maps stay the same and the first guess moves by no more than this in
    /// the common section, metres.
    #[schemars(range(min = 0.0))]
    pub reuse_within: f64,
    /// An accepted alignment is reused while the maps stay the same and the first guess turns by no more than this,
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

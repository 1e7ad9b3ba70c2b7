//! The parameters of the stage.

use crate::walls::NORMAL_RADIUS;
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
#[derive(Clone, Debug, Deserialize, JsonSchema)]
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
    pub min_distance: f64,
    /// The factor by which that distance shrinks with every iteration, above 0 and below 1.
    pub shrink: f64,
    /// The most iterations at that last distance; an alignment that still moves then is refused.
    pub max_iterations: usize,
    /// Registration has converged when an iteration moves the wall points by less than this, metres.
    pub convergence: f64,
    /// The number of points that the iterations before the last distance make do with.
    pub coarse_points: usize,
    /// Where the first guess's rotation is vague, rotations this far apart are tried as starts, as far as two standard
    /// deviations to either side, radians.
    pub start_spacing: f64,
    /// The radius in which a wall's direction is measured, metres.
    pub normal_radius: f64,
    /// The length of wall that counts as one independent measurement, metres: the errors of cells that stand side by
    /// side are alike. It scales the covariance.
    pub correlation_length: f64,
    /// Standard deviation of x and y of a first guess that brings no covariance, metres.
    pub initial_position_deviation: f64,
    /// Standard deviation of the rotation of a first guess that brings no covariance, radians.
    pub initial_yaw_deviation: f64,
    /// Added to the first guess's own uncertainty, as a standard deviation of x and y in the common section, metres.
    pub position_slack: f64,
    /// Added to the first guess's own uncertainty, as a standard deviation of the rotation, radians.
    pub yaw_slack: f64,
    /// How many standard deviations of the first guess the refined transform may lie away from it.
    pub max_step: f64,
    /// The greatest standard deviation of the position in the common section, in any direction, metres.
    pub max_position_deviation: f64,
    /// The greatest standard deviation of the rotation, radians.
    pub max_yaw_deviation: f64,
    /// An accepted alignment is kept while the maps stay the same and the first guess moves by no more than this in the
    /// common section, metres.
    pub reuse_within: f64,
    /// An accepted alignment is kept while the maps stay the same and the first guess turns by no more than this,
    /// radians.
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
            max_position_deviation: 0.2,
            max_yaw_deviation: 0.02,
            reuse_within: 0.05,
            reuse_within_yaw: 0.01,
        }
    }
}

impl Parameters for IcpParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let positive = [
            ("min_distance", self.min_distance),
            ("convergence", self.convergence),
            ("start_spacing", self.start_spacing),
            ("normal_radius", self.normal_radius),
            ("correlation_length", self.correlation_length),
            ("initial_position_deviation", self.initial_position_deviation),
            ("initial_yaw_deviation", self.initial_yaw_deviation),
            ("position_slack", self.position_slack),
            ("yaw_slack", self.yaw_slack),
            ("max_step", self.max_step),
            ("max_position_deviation", self.max_position_deviation),
            ("max_yaw_deviation", self.max_yaw_deviation),
        ];
        for (field, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                errors.push(ParameterError::new(field, format!("must be a finite number above 0, not {value}")));
            }
        }
        let not_negative = [("reuse_within", self.reuse_within), ("reuse_within_yaw", self.reuse_within_yaw)];
        for (field, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                errors.push(ParameterError::new(field, format!("must be a finite number from 0 up, not {value}")));
            }
        }
        if !(self.max_distance.is_finite() && self.max_distance >= self.min_distance) {
            errors.push(ParameterError::new("max_distance", "must be finite and at least min_distance"));
        }
        if !(self.shrink > 0.0 && self.shrink < 1.0) {
            errors.push(ParameterError::new("shrink", format!("must lie between 0 and 1, not {}", self.shrink)));
        }
        for (field, value) in [("max_iterations", self.max_iterations), ("coarse_points", self.coarse_points)] {
            if value == 0 {
                errors.push(ParameterError::new(field, "must be at least 1"));
            }
        }
        errors
    }
}

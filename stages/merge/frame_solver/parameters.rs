//! Parameters of the frame solver.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the frame solver.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrameSolverParameters {
    /// Largest Mahalanobis distance of a cycle of alignments from the identity; beyond that they contradict each
    /// other. With three degrees of freedom 4.0 is exceeded by chance once in a thousand times.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gate: f64,
    /// Standard deviation of x and of y that is added to the covariance of every alignment, metres. It covers what
    /// the covariance does not include: the cell size, and deformed maps.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub position_floor: f64,
    /// Standard deviation of the rotation that is added to the covariance of every alignment, radians.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_floor: f64,
    /// Least improvement of the fit before robots that have been sent are moved: the sum of the squared Mahalanobis
    /// distances of all alignments must fall by more than this. A robot with one alignment is moved by a third of its
    /// standard deviation at 0.1. With 0 every change is sent. At the end the best solution is sent in any case.
    #[schemars(range(min = 0.0))]
    pub min_improvement: f64,
}

impl Default for FrameSolverParameters {
    fn default() -> Self {
        Self { gate: 4.0, position_floor: 0.05, yaw_floor: 0.005, min_improvement: 0.1 }
    }
}

impl Parameters for FrameSolverParameters {}

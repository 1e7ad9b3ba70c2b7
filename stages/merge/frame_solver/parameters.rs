//! The parameters of the frame solver.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parameters of the frame solver.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrameSolverParameters {
    /// How far a cycle of alignments may be from closing, in standard deviations (Mahalanobis distance); beyond that
    /// they contradict each other. With three degrees of freedom 4.0 is passed by chance once in a thousand times.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gate: f64,
    /// Deviation in metres that every alignment is taken to have beyond its own covariance, in x and in y. It covers
    /// what the covariance does not know: the size of the cells, and maps that are bent.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub position_floor: f64,
    /// Deviation in radians that every alignment is taken to have beyond its own covariance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub yaw_floor: f64,
    /// How much better the alignments must fit another solution before robots that have been sent are moved: the sum of
    /// the squared deviations (Mahalanobis distances) of all alignments must fall by more than this. A robot that one
    /// alignment places is moved by a third of its standard deviation at 0.1. With 0 every change is sent. At the end
    /// the best solution is sent in any case.
    #[schemars(range(min = 0.0))]
    pub min_improvement: f64,
}

impl Default for FrameSolverParameters {
    fn default() -> Self {
        Self { gate: 4.0, position_floor: 0.05, yaw_floor: 0.005, min_improvement: 0.1 }
    }
}

impl Parameters for FrameSolverParameters {}

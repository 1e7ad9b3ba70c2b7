//! The parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the uncertain transform. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UncertainTransformParameters {
    /// Metres a cell in the world. If it is not given: that of the reference robot's map.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub resolution: Option<f64>,
    /// Metres. A place whose standard deviation is greater is blurred as if it had this one. The time goes with its
    /// square.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub max_deviation: f64,
    /// Probability that a cell of value 100 is occupied; greater ones are clamped to it.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub max_probability: f64,
    /// Probability that a cell of value 0 is occupied; lesser ones are clamped to it.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub min_probability: f64,
    /// Metres. The longest side that a map may have in the world; one that would be longer is left out with a warning.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_extent: f64,
    /// The most cells that a map may have in the world; one that would have more is left out with a warning.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub max_cells: u64,
}

impl Default for UncertainTransformParameters {
    fn default() -> Self {
        Self {
            resolution: None,
            max_deviation: 0.5,
            max_probability: 0.971,
            min_probability: 0.1192,
            max_extent: 1000.0,
            max_cells: 100_000_000,
        }
    }
}

impl Parameters for UncertainTransformParameters {}

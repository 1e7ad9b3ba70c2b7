//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the entropy fuser. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EntropyFuserParameters {
    /// Probability that a cell of value 100 is occupied; greater ones are clamped to it.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub max_probability: f64,
    /// Probability that a cell of value 0 is occupied; lesser ones are clamped to it.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub min_probability: f64,
    /// Largest number of cells of the fused map; a map that would make it larger is left out with a warning.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub max_cells: u64,
}

impl Default for EntropyFuserParameters {
    fn default() -> Self {
        Self { max_probability: 0.971, min_probability: 0.1192, max_cells: 100_000_000 }
    }
}

impl Parameters for EntropyFuserParameters {}

//! The parameters of the stage.

use crate::log_odds::check_bounds;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the entropy fuser. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EntropyFuserParameters {
    /// Probability that a cell is occupied when a map says 100; greater values are cut to it.
    pub max_probability: f64,
    /// Probability that a cell is occupied when a map says 0; lesser values are cut to it.
    pub min_probability: f64,
    /// The most cells that the fused map may have; a map that would make it larger is left out with a warning.
    pub max_cells: u64,
}

impl Default for EntropyFuserParameters {
    fn default() -> Self {
        Self { max_probability: 0.971, min_probability: 0.1192, max_cells: 100_000_000 }
    }
}

impl Parameters for EntropyFuserParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = check_bounds(self.min_probability, self.max_probability);
        if !(1..=u64::from(u32::MAX)).contains(&self.max_cells) {
            errors.push(ParameterError::new("max_cells", "must be 1 to 4294967295"));
        }
        errors
    }
}

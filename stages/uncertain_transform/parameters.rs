//! The parameters of the stage.

use crate::log_odds::check_bounds;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the uncertain transform. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UncertainTransformParameters {
    /// Metres a cell in the world. If it is not given: that of the reference robot's map.
    pub resolution: Option<f64>,
    /// Metres. A place whose standard deviation is greater is blurred as if it had this one. The time goes with its square.
    pub max_deviation: f64,
    /// Probability that a cell is occupied when a map says 100; greater values are cut to it.
    pub max_probability: f64,
    /// Probability that a cell is occupied when a map says 0; lesser values are cut to it.
    pub min_probability: f64,
    /// Metres. The longest side that a map may have in the world; one that would be longer is left out with a warning.
    pub max_extent: f64,
    /// The most cells that a map may have in the world; one that would have more is left out with a warning.
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

impl Parameters for UncertainTransformParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = check_bounds(self.min_probability, self.max_probability);
        let is_length = |value: f64| value.is_finite() && value > 0.0;
        if !self.resolution.is_none_or(is_length) {
            errors.push(ParameterError::new("resolution", "must be above 0 m"));
        }
        if !(0.0..=10.0).contains(&self.max_deviation) {
            let problem = format!("must lie between 0 and 10, not {}", self.max_deviation);
            errors.push(ParameterError::new("max_deviation", problem));
        }
        if !is_length(self.max_extent) {
            errors.push(ParameterError::new("max_extent", "must be above 0 m"));
        }
        if !(1..=u64::from(u32::MAX)).contains(&self.max_cells) {
            errors.push(ParameterError::new("max_cells", "must be 1 to 4294967295"));
        }
        errors
    }
}

//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the map selector. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSelectorParameters {
    /// A map is passed on if at least so many cells have become free, occupied or unknown since the map of the robot that was
    /// passed on before, as a share of the cells known then: with 1 about when what is known has doubled. 0 passes on all maps.
    pub min_change: f64,
}

impl Default for MapSelectorParameters {
    fn default() -> Self {
        Self { min_change: 1.0 }
    }
}

impl Parameters for MapSelectorParameters {
    fn check(&self) -> Vec<ParameterError> {
        if (0.0..=1e6).contains(&self.min_change) {
            return Vec::new();
        }
        let problem = format!("must lie between 0 and 1000000, not {}", self.min_change);
        vec![ParameterError::new("min_change", problem)]
    }
}

//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the map selector. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapSelectorParameters {
    /// Least number of cells that have become free, occupied or unknown since the map of the robot that was passed on
    /// before, as a share of the cells known then: 1 is about twice the known area. 0 passes on all maps.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_change: f64,
}

impl Default for MapSelectorParameters {
    fn default() -> Self {
        Self { min_change: 1.0 }
    }
}

impl Parameters for MapSelectorParameters {}

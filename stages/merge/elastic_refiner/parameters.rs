//! The parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the elastic refiner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ElasticRefinerParameters {
    /// Whether maps are bent. If not, frames go through and nothing else is sent: the maps are rigid.
    pub enabled: bool,
    /// Whether the map of the reference robot stays as it is, and only the others are bent onto it.
    pub keep_reference: bool,
    /// Metres from node to node: within such a distance a map counts as rigid.
    #[schemars(range(min = 0.5, max = 100.0))]
    pub spacing: f64,
    /// How maps bend: standard deviation of the displacement of two places of a map against each other, metres for the root of
    /// each metre between them. What a map was found to do is told with its bend.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub bend: f64,
    /// How maps turn: standard deviation of the turn of two places of a map against each other, radians for the root of each
    /// metre between them.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub turn: f64,
    /// Metres. Walls that lie farther apart, as the rigid frames have them, are not laid on each other.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub reach: f64,
    /// Metres. While the robots explore, the bends are estimated again when a frame has moved by more than this; at the end
    /// they are in any case.
    #[schemars(range(min = 0.0))]
    pub min_move: f64,
    /// Radians. The same when a frame has turned by more than this.
    #[schemars(range(min = 0.0))]
    pub min_turn: f64,
    /// The same when a map covers more than before by this share.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_growth: f64,
}

impl Default for ElasticRefinerParameters {
    fn default() -> Self {
        Self {
            enabled: true,
            keep_reference: false,
            spacing: 3.0,
            bend: 0.05,
            turn: 0.01,
            reach: 2.0,
            min_move: 0.1,
            min_turn: 0.01,
            min_growth: 0.25,
        }
    }
}

impl Parameters for ElasticRefinerParameters {}

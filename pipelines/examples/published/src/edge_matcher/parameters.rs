//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the edge matcher. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeMatcherParameters {
    /// Least length of an edge, metres: all short edges are alike.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub min_length: f64,
    /// Largest difference of the lengths of similar edges, as a share of the longer one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub length_tolerance: f64,
    /// Largest distance of the points of similar edges with their centroids aligned, metres (root mean square).
    #[schemars(range(min = 0.0, max = 1e2))]
    pub shape_tolerance: f64,
    /// Largest distance of votes for one translation, metres.
    #[schemars(range(min = 1e-3, max = 1e2))]
    pub vote_radius: f64,
    /// Least number of edges of each map that vote for an accepted translation.
    #[schemars(range(min = 1))]
    pub min_edges: usize,
    /// Largest weight of the second-best translation, as a share of that of an accepted one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_runner_up: f64,
}

impl Default for EdgeMatcherParameters {
    fn default() -> Self {
        Self {
            min_length: 1.0,
            length_tolerance: 0.15,
            shape_tolerance: 0.2,
            vote_radius: 0.3,
            min_edges: 3,
            max_runner_up: 0.7,
        }
    }
}

impl Parameters for EdgeMatcherParameters {}

//! The parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the edge matcher. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeMatcherParameters {
    /// Edges shorter than this are left out, metres: all short edges are alike.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub min_length: f64,
    /// Two edges may be alike if their lengths differ by no more than this share of the longer one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub length_tolerance: f64,
    /// Two edges are alike if their points lie within this distance of each other, with the middles of both laid on each other,
    /// metres (root of the mean square).
    #[schemars(range(min = 0.0, max = 1e2))]
    pub shape_tolerance: f64,
    /// Votes within this distance of each other are for one translation, metres.
    #[schemars(range(min = 1e-3, max = 1e2))]
    pub vote_radius: f64,
    /// The least number of edges of each map that vote for the translation that is taken.
    #[schemars(range(min = 1))]
    pub min_edges: usize,
    /// The most that the best translation elsewhere may gather of the votes of the one that is taken.
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

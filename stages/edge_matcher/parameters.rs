//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the edge matcher. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeMatcherParameters {
    /// Edges shorter than this are left out, metres: all short edges are alike.
    pub min_length: f64,
    /// Two edges may be alike if their lengths differ by no more than this share of the longer one, 0 to 1.
    pub length_tolerance: f64,
    /// Two edges are alike if their points lie within this distance of each other, with the middles of both laid on each other,
    /// metres (root of the mean square).
    pub shape_tolerance: f64,
    /// Votes within this distance of each other are for one translation, metres.
    pub vote_radius: f64,
    /// The least number of edges of each map that vote for the translation that is taken.
    pub min_edges: usize,
    /// The most that the best translation elsewhere may gather of the votes of the one that is taken, 0 to 1.
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

impl Parameters for EdgeMatcherParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let ranges = [
            ("min_length", self.min_length, 0.0, 1e3),
            ("length_tolerance", self.length_tolerance, 0.0, 1.0),
            ("shape_tolerance", self.shape_tolerance, 0.0, 1e2),
            ("vote_radius", self.vote_radius, 1e-3, 1e2),
            ("max_runner_up", self.max_runner_up, 0.0, 1.0),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        if self.min_edges == 0 {
            errors.push(ParameterError::new("min_edges", "must be at least 1"));
        }
        errors
    }
}

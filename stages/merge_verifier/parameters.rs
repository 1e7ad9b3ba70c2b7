//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Parameters of the merge verifier. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MergeVerifierParameters {
    /// The least probability of being right at which an alignment is accepted, 0 to 1.
    pub accept: f64,
    /// Two walls agree when they lie within this distance, metres; never less than 1.5 cells of the coarser map.
    pub wall_tolerance: f64,
    /// Maps are compared in squares of this side, each of which may slide a little: a map is right in every room and bent as
    /// a whole. Metres.
    pub region: f64,
    /// Standard deviation of how far a region slides, metres.
    pub slide_deviation: f64,
    /// Where a provisional alignment comes from a stage that has not looked for others itself, map b is also laid
    /// elsewhere: turned by quarter turns, and moved by up to this many metres. 0 only turns it.
    pub rival_reach: f64,
    /// How maps bend, as for the `elastic_refiner`: standard deviation of the displacement of two places of a map against each
    /// other, metres for the root of each metre between them. Maps that contradict each other are compared once more with
    /// one bent onto the other. 0 compares them as they came.
    pub bend: f64,
    /// How maps turn, as for the `elastic_refiner`: standard deviation of the turn of two places of a map against each other,
    /// radians for the root of each metre between them.
    pub turn: f64,
    /// Which of the hypotheses that a refusal has listed is right, by somebody who has looked: by robot, which means its
    /// pair with the reference or with the only other robot, or by pair as ROBOT/ROBOT. From 1; 0 is the initial pose itself.
    pub hypotheses: BTreeMap<String, usize>,
}

impl Default for MergeVerifierParameters {
    fn default() -> Self {
        Self {
            accept: 0.999,
            wall_tolerance: 0.1,
            region: 3.0,
            slide_deviation: 0.12,
            rival_reach: 4.0,
            bend: 0.05,
            turn: 0.01,
            hypotheses: BTreeMap::new(),
        }
    }
}

impl Parameters for MergeVerifierParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        // Beyond the greatest reach thousands of places are tried.
        let ranges = [
            ("accept", self.accept, 0.0, 1.0),
            ("wall_tolerance", self.wall_tolerance, 1e-3, 10.0),
            ("region", self.region, 0.1, 100.0),
            ("slide_deviation", self.slide_deviation, 1e-3, 10.0),
            ("rival_reach", self.rival_reach, 0.0, 100.0),
            ("turn", self.turn, 1e-6, 1.0),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        // Between them, squares of their inverses are no numbers.
        if self.bend != 0.0 && !(1e-6..=10.0).contains(&self.bend) {
            errors
                .push(ParameterError::new("bend", format!("must be 0 or lie between 1e-6 and 10, not {}", self.bend)));
        }
        errors
    }
}

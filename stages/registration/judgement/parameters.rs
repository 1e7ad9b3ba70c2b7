//! The parameters of the stage.

use crate::registration::comparison::ComparisonParameters;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of the merge verifier. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JudgementParameters {
    /// The least probability of being right at which an alignment is accepted.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accept: f64,
    /// Two walls agree when they lie within this distance, metres; never less than 1.5 cells of the coarser map.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub wall_tolerance: f64,
    /// Maps are compared in squares of this side, each of which may be moved a little: a map is right in every room and bent as
    /// a whole. Metres.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub region: f64,
    /// Standard deviation of how far a region is moved, metres.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub region_deviation: f64,
    /// How maps bend: standard deviation of the displacement of two places of a map against each other, metres for the root of each
    /// metre between them; more than `elastic_refiner` has, as maps of any sensor are to be told from those of other places. Maps that
    /// contradict each other are compared once more with one bent onto the other. 0 compares them as they came.
    pub bend: f64,
    /// Maps that are bent by more than this against each other, the root mean square, have no one place, and are refused, metres. Each of
    /// them may be right in every room; a greater value merges them where most of map b lies nearest.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub max_bend: f64,
    /// How maps turn: standard deviation of the turn of two places of a map against each other,
    /// radians for the root of each metre between them.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub turn: f64,
    /// Which of the hypotheses that a refusal has listed is right, by somebody who has looked: by robot, which means its
    /// pair with the reference or with the only other robot, or by pair as ROBOT/ROBOT. From 1; 0 is the initial pose itself.
    pub hypotheses: BTreeMap<String, usize>,
}

impl Default for JudgementParameters {
    fn default() -> Self {
        Self {
            accept: 0.98,
            wall_tolerance: 0.1,
            region: 3.0,
            region_deviation: 0.12,
            bend: 0.1,
            max_bend: 0.5,
            turn: 0.02,
            hypotheses: BTreeMap::new(),
        }
    }
}

impl JudgementParameters {
    /// Those of the comparison.
    pub fn comparison(&self) -> ComparisonParameters {
        let Self { wall_tolerance, region, region_deviation, bend, turn, .. } = *self;
        ComparisonParameters { wall_tolerance, region, region_deviation, bend, turn }
    }
}

impl Parameters for JudgementParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        // Between them, squares of their inverses are no numbers.
        let is_usable = self.bend == 0.0 || (1e-6..=10.0).contains(&self.bend);
        let problem = || format!("must be 0 or lie between 1e-6 and 10, not {}", self.bend);
        (!is_usable).then(|| ParameterError::new("bend", problem())).into_iter().collect()
    }
}

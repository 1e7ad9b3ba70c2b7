//! Parameters of the stage.

use crate::registration::comparison::ComparisonParameters;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of the merge verifier. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JudgementParameters {
    /// Least probability of being right at which an alignment is accepted.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub accept: f64,
    /// Distance within which two walls agree, metres; never less than 1.5 cells of the coarser map.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub wall_tolerance: f64,
    /// Side of the square regions in which maps are compared, metres. Each may be shifted a little: a map is right in
    /// every room and deformed as a whole.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub region: f64,
    /// Standard deviation of the shift of a region, metres.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub region_deviation: f64,
    /// Deformation: standard deviation of the displacement of two points of a map against each other, metres per
    /// square root of a metre between them. It is more than that of `elastic_refiner`, as it must hold for maps of
    /// any sensor. Maps that contradict each other are compared once more with one deformed onto the other. 0
    /// compares them without deformation.
    pub bend: f64,
    /// Largest deformation of two maps against each other, root mean square, metres. Maps that are deformed more have
    /// no common rigid pose, and are refused; each of them may be right in every room. A greater value merges them at
    /// the nearest rigid pose.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub max_bend: f64,
    /// Deformation: standard deviation of the turn of two points of a map against each other, radians per square root
    /// of a metre between them.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub turn: f64,
    /// Largest error of the resolution of a map that is looked for at the end, as a share of it, where a robot is
    /// merged with no other: the reason then names the scale at which the maps agree. Where there is none, half and
    /// twice the resolution are looked for. 0 looks for none, as that takes as long as many searches.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub scale_range: f64,
    /// Number of the right hypothesis in the list of a refusal, as the user has chosen it. The key is a robot, for
    /// its pair with the reference or with the only other robot, or a pair as ROBOT/ROBOT. From 1; 0 is the initial
    /// pose itself.
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
            scale_range: 0.0,
            hypotheses: BTreeMap::new(),
        }
    }
}

impl JudgementParameters {
    /// Parameters of the comparison.
    pub fn comparison(&self) -> ComparisonParameters {
        let Self { wall_tolerance, region, region_deviation, bend, turn, .. } = *self;
        ComparisonParameters { wall_tolerance, region, region_deviation, bend, turn }
    }
}

impl Parameters for JudgementParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        // Outside of these bounds, squares or their inverses overflow.
        let is_usable = self.bend == 0.0 || (1e-6..=10.0).contains(&self.bend);
        let problem = || format!("must be 0 or lie between 1e-6 and 10, not {}", self.bend);
        (!is_usable).then(|| ParameterError::new("bend", problem())).into_iter().collect()
    }
}

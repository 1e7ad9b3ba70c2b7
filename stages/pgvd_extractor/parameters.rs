//! The parameters of the stage.

use crate::skeleton::SkeletonParameters;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the extractor. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PgvdExtractorParameters {
    /// Objects and unknown spots in free space that cover no more than this are taken for free, square metres: the skeleton
    /// would go round each of them.
    pub max_hole: f64,
    /// The skeleton does not pass where an obstacle or an unknown cell is nearer than this, metres.
    pub min_clearance: f64,
    /// A way that leads from a junction to an end is left out if it reaches less far than this beyond what a square corner
    /// would give, metres.
    pub min_spur: f64,
    /// The least probability of a path that is sent, 0 to 1.
    pub min_probability: f64,
}

impl Default for PgvdExtractorParameters {
    fn default() -> Self {
        let SkeletonParameters { max_hole, min_clearance, min_spur } = SkeletonParameters::default();
        Self { max_hole, min_clearance, min_spur, min_probability: 0.0 }
    }
}

impl PgvdExtractorParameters {
    /// Those of the skeleton.
    pub fn skeleton(&self) -> SkeletonParameters {
        let Self { max_hole, min_clearance, min_spur, .. } = *self;
        SkeletonParameters { max_hole, min_clearance, min_spur }
    }
}

impl Parameters for PgvdExtractorParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let ranges = [
            ("max_hole", self.max_hole, 0.0, 1e3),
            ("min_clearance", self.min_clearance, 0.0, 1e2),
            ("min_spur", self.min_spur, 0.0, 1e3),
            ("min_probability", self.min_probability, 0.0, 1.0),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        errors
    }
}

//! The parameters of the stage.

use crate::topology::skeleton::SkeletonParameters;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the extractor. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PgvdExtractorParameters {
    /// Objects and unknown spots in free space that cover no more than this are taken for free, square metres: the skeleton
    /// would go round each of them.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub max_hole: f64,
    /// The skeleton does not pass where an obstacle or an unknown cell is nearer than this, metres.
    #[schemars(range(min = 0.0, max = 1e2))]
    pub min_clearance: f64,
    /// A way that leads from a junction to an end is left out if it reaches less far than this beyond what a square corner
    /// would give, metres.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub min_spur: f64,
    /// The least probability of a path that is sent.
    #[schemars(range(min = 0.0, max = 1.0))]
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

impl Parameters for PgvdExtractorParameters {}

//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use gridweave_stages::topology::skeleton::SkeletonParameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the extractor. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PgvdExtractorParameters {
    /// Largest area of objects and unknown spots in free space that are treated as free, square metres: the skeleton
    /// would go round each of them.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub max_hole: f64,
    /// Least distance of the skeleton from obstacles and unknown cells, metres.
    #[schemars(range(min = 0.0, max = 1e2))]
    pub min_clearance: f64,
    /// A path from a junction to an end is left out if it extends less than this beyond a square corner, metres.
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

//! The parameters of the stage.

use crate::topology::skeleton::SkeletonParameters;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the topology extractor. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyExtractorParameters {
    /// Objects and unknown spots in free space that cover no more than this are taken for free, square metres: a way would go
    /// round each of them.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub max_hole: f64,
    /// Ways do not pass where an obstacle or an unknown cell is nearer than this, metres: half the width of the narrowest way.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub min_clearance: f64,
    /// A way that leads from a junction to an end is left out if it reaches less far than this beyond what a square corner
    /// would give, metres: it comes from a corner or a rough wall, and leads nowhere.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub min_spur: f64,
    /// Pieces of the map are left out whose ways together with the width at their widest are shorter than this, metres: what a
    /// beam has seen through a window.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_piece: f64,
    /// A narrow place of a way is a door if it is at most so wide, metres, and `door_widening` holds.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_door_width: f64,
    /// A narrow place of a way is a door if the way is so many times wider before it and behind it, and `max_door_width`
    /// holds.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub door_widening: f64,
}

impl Default for TopologyExtractorParameters {
    fn default() -> Self {
        let SkeletonParameters { max_hole, min_clearance, min_spur } = SkeletonParameters::default();
        Self { max_hole, min_clearance, min_spur, min_piece: 2.0, max_door_width: 1.6, door_widening: 1.4 }
    }
}

impl TopologyExtractorParameters {
    /// Those of the skeleton among them.
    pub fn skeleton(&self) -> SkeletonParameters {
        SkeletonParameters { max_hole: self.max_hole, min_clearance: self.min_clearance, min_spur: self.min_spur }
    }
}

impl Parameters for TopologyExtractorParameters {}

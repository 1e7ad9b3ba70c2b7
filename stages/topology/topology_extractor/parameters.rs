//! Parameters of the stage.

use crate::topology::skeleton::SkeletonParameters;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the topology extractor. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyExtractorParameters {
    /// Largest area of objects and unknown spots in free space that are treated as free, square metres: a path would
    /// go round each of them.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub max_hole: f64,
    /// Least distance of paths from obstacles and unknown cells, metres: half the width of the narrowest path.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub min_clearance: f64,
    /// A path from a junction to an end is left out if it extends less than this beyond a square corner, metres: it
    /// comes from a corner or a rough wall.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub min_spur: f64,
    /// Least length of a piece of the map: its paths together with the width at their widest, metres. Shorter ones
    /// are what a beam has seen through a window.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_piece: f64,
    /// Largest width of a door, metres, if `door_widening` holds.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub max_door_width: f64,
    /// Least factor by which the path is wider before and after a door, if `max_door_width` holds.
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

//! Parameters of the stage.

use crate::registration::non_rigid::DeformationParameters;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the elastic refiner. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ElasticRefinerParameters {
    /// Whether maps are deformed. If not, frames are passed on and nothing else is sent: the maps are rigid.
    pub enabled: bool,
    /// Whether the map of the reference robot stays as it is, and only the others are deformed to align with it.
    pub keep_reference: bool,
    /// Spacing of the nodes, metres: within such a distance a map counts as rigid.
    #[schemars(range(min = 0.5, max = 100.0))]
    pub spacing: f64,
    /// Deformation: standard deviation of the displacement of two points of a map against each other, metres per
    /// square root of a metre between them. The estimate from a map's walls is sent with its deformation.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub bend: f64,
    /// Deformation: standard deviation of the turn of two points of a map against each other, radians per square root
    /// of a metre between them.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub turn: f64,
    /// Largest distance of walls, with rigid frames, that are aligned with each other, metres.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub reach: f64,
    /// While the robots explore, the deformations are estimated again when a frame has moved by more than this,
    /// metres. At the end they are estimated in any case.
    #[schemars(range(min = 0.0))]
    pub min_move: f64,
    /// The same when a frame has turned by more than this, radians.
    #[schemars(range(min = 0.0))]
    pub min_turn: f64,
    /// The same when the area of a map has grown by more than this share. The others then stay as they are, and are
    /// estimated again once the maps that were aligned with them make up more than this share of all.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_growth: f64,
}

impl ElasticRefinerParameters {
    /// Those of the deformation itself.
    pub fn deformation(&self) -> DeformationParameters {
        let Self { spacing, bend, turn, reach, .. } = *self;
        DeformationParameters { spacing, bend, turn, reach }
    }
}

impl Default for ElasticRefinerParameters {
    fn default() -> Self {
        let DeformationParameters { spacing, bend, turn, reach } = DeformationParameters::default();
        Self {
            enabled: true,
            keep_reference: false,
            spacing,
            bend,
            turn,
            reach,
            min_move: 0.1,
            min_turn: 0.01,
            min_growth: 0.25,
        }
    }
}

impl Parameters for ElasticRefinerParameters {}

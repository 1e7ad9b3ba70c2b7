//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the map cleaner. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapCleanerParameters {
    /// Occupied cells within this distance along x and along y belong to one object, metres; never less than two
    /// cells, so that a wall without single cells stays whole.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub link: f64,
    /// Least diagonal of the bounding box of a wall, metres; legs, people and dust are shorter.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub min_wall_length: f64,
    /// Least share of that diagonal that the cells of a wall would fill in a row. Single cells that are near each
    /// other by chance fill less.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_fill: f64,
    /// Least width of known space, metres; narrower space is removed, such as the rays of a lidar through glass and
    /// open doors.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub min_passage: f64,
}

impl Default for MapCleanerParameters {
    fn default() -> Self {
        Self { link: 0.1, min_wall_length: 0.35, min_fill: 0.6, min_passage: 0.25 }
    }
}

impl Parameters for MapCleanerParameters {}

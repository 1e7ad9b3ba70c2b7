//! Parameters of the grid fuser.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How cells of a robot's map are transformed to the fused one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Warp {
    /// Every cell of the fused map takes the value of the cell that contains its centre: no gaps and no blur. Walls
    /// stay closed, but a single cell of a turned map may be between the centres and be lost.
    #[default]
    Inverse,
    /// Every known cell of a robot's map is added to the cell that contains its centre, and the gaps that rounding
    /// leaves take the mean of the free cells around them (the paper).
    Forward,
}

/// Parameters of the grid fuser.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridFuserParameters {
    /// How cells of a robot's map are transformed to the fused one.
    pub warp: Warp,
    /// Resolution of the fused map, metres per cell. If it is not given: the finest of the maps' resolutions (the
    /// paper: 0.02 m). A value coarser than the maps' leaves cells out, thin walls among them.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub resolution: Option<f64>,
    /// Probability that a cell of value 100 is occupied. Greater ones are clamped to it before maps are added, so
    /// that no map is certain. 0.971 is the upper clamping threshold of OctoMap.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub max_probability: f64,
    /// Probability that a cell of value 0 is occupied. 0.1192 is the lower clamping threshold of OctoMap. With the
    /// default pair one map's wall outweighs another map's free cell, as for a wall that is off by a cell.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub min_probability: f64,
    /// The map is fused again when a robot's frame has moved by more than this, metres.
    #[schemars(range(min = 0.0))]
    pub min_move: f64,
    /// The map is fused again when a robot's frame has turned by more than this, radians.
    #[schemars(range(min = 0.0))]
    pub min_turn: f64,
    /// Longest side of the fused map, metres; a robot whose map would make it longer is left out with a warning.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_extent: f64,
    /// Largest number of cells of the fused map; a robot whose map would make it larger is left out with a warning,
    /// and so is one so far away that nearly all of the fused map would be unknown.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub max_cells: u64,
}

impl Default for GridFuserParameters {
    fn default() -> Self {
        Self {
            warp: Warp::Inverse,
            resolution: None,
            max_probability: 0.971,
            min_probability: 0.1192,
            min_move: 0.02,
            min_turn: 0.002,
            max_extent: 1000.0,
            max_cells: 100_000_000,
        }
    }
}

impl Parameters for GridFuserParameters {}

//! The parameters of the grid fuser.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How cells get from a robot's map to the fused one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Warp {
    /// Every cell of the fused map takes the value of the cell that its centre falls in: no gaps and no blur. Walls stay
    /// closed, but a single cell of a turned map may lie between the centres and be lost.
    #[default]
    Inverse,
    /// Every known cell of a robot's map goes to the cell that its centre falls in, and the gaps that rounding leaves
    /// take the mean of the free cells around them (the paper).
    Forward,
}

/// The parameters of the grid fuser.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridFuserParameters {
    /// How cells get from a robot's map to the fused one.
    pub warp: Warp,
    /// Metres a cell of the fused map. If it is not given: the finest of the maps' resolutions (the paper: 0.02 m). A
    /// value coarser than the maps' leaves cells out, thin walls among them.
    pub resolution: Option<f64>,
    /// Probability that a cell is occupied when a map says 100. Greater values are cut to it before maps are added, so
    /// that no map is ever beyond doubt. 0.971 is the upper clamping threshold of OctoMap.
    pub max_probability: f64,
    /// Probability that a cell is occupied when a map says 0. 0.1192 is the lower clamping threshold of OctoMap. With
    /// the default pair one map's wall outweighs another map's free cell, as a wall that is off by a cell should.
    pub min_probability: f64,
    /// Metres. The map is fused again when a robot's frame has moved by more than this.
    pub min_move: f64,
    /// Radians. The map is fused again when a robot's frame has turned by more than this.
    pub min_turn: f64,
    /// Metres. The longest side that the fused map may have; a robot whose map would make it longer is left out with a
    /// warning.
    pub max_extent: f64,
    /// The most cells that the fused map may have; a robot whose map would make it larger is left out with a warning, and so
    /// is one that lies so far away that next to nothing of the fused map would be known.
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

impl Parameters for GridFuserParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let mut require = |holds: bool, field, problem: &str| {
            if !holds {
                errors.push(ParameterError::new(field, problem));
            }
        };
        let is_length = |value: f64| value.is_finite() && value > 0.0;
        require(self.resolution.is_none_or(is_length), "resolution", "must be above 0 m");
        let is_high = self.max_probability > 0.5 && self.max_probability < 1.0;
        require(is_high, "max_probability", "must be above 0.5 and below 1");
        let is_low = self.min_probability > 0.0 && self.min_probability < 0.5;
        require(is_low, "min_probability", "must be above 0 and below 0.5");
        require(self.min_move.is_finite() && self.min_move >= 0.0, "min_move", "must be 0 m or above");
        require(self.min_turn.is_finite() && self.min_turn >= 0.0, "min_turn", "must be 0 rad or above");
        require(is_length(self.max_extent), "max_extent", "must be above 0 m");
        let fits = (1..=u64::from(u32::MAX)).contains(&self.max_cells);
        require(fits, "max_cells", "must be 1 to 4294967295");
        errors
    }
}

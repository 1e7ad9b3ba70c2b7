//! The parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Parameters of the Radon aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadonAlignerParameters {
    /// The step between two angles of the Radon transform, radians; a quarter turn is cut into the nearest whole number
    /// of them.
    #[schemars(range(min = 1e-4, max = 0.1))]
    pub angle_step: f64,
    /// The least correlation of the energies of two maps over the angle, up to 1, at which a rotation is taken from
    /// them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_correlation: f64,
    /// As many shifts are tried on each of the two axes of the walls, at each of the four rotations.
    #[schemars(range(min = 1, max = 100))]
    pub shifts: usize,
    /// The least share that two maps must have in common of the smaller one's known cells, 0 to 1, for a place to
    /// count.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_overlap: f64,
    /// The least acceptance index at which an alignment is accepted, 0 to 1: the share of the cells known to both maps
    /// on which they agree. The method has no other test, and none that is sure: right places in nine real logs had
    /// 0.963 and more, the best ones of unrelated maps up to 0.945.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_similarity: f64,
    /// Largest extent of the walls of a map that is aligned, metres.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub max_extent: f64,
}

impl Default for RadonAlignerParameters {
    fn default() -> Self {
        Self {
            angle_step: TAU / 1440.0,
            min_correlation: 0.3,
            shifts: 12,
            min_overlap: 0.2,
            min_similarity: 0.95,
            max_extent: 400.0,
        }
    }
}

impl RadonAlignerParameters {
    /// The number of angles in a quarter turn.
    pub fn steps(&self) -> usize {
        (FRAC_PI_2 / self.angle_step).round() as usize
    }
}

impl Parameters for RadonAlignerParameters {}

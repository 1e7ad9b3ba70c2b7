//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// Parameters of the map aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapAlignerParameters {
    /// The side of a cell in which all places are tried, metres; never less than 1.5 cells of the coarser map.
    pub cell: f64,
    /// The rotations that are tried lie at most this far apart, radians.
    pub rotation_step: f64,
    /// How much a cell of wall that lies on known free space of the other map counts against a place, where a cell of
    /// wall on wall counts 1 for it.
    pub free_space_penalty: f64,
    /// Another place differs from the best by a rotation of more than this, radians, or by `apart`.
    pub apart_yaw: f64,
    /// Another place differs from the best by more than this in the middle of the walls in common, metres, or by
    /// `apart_yaw`.
    pub apart: f64,
    /// The guess is refused as ambiguous if another place scores more than this share of the best, 0 to 1. In maps of six
    /// buildings that were drawn from laser scans and of 36 simulated ones, other places have 0.22 to 0.63 in pairs that
    /// belong together, and 0.58 to 1.0 in pairs that do not.
    pub max_runner_up: f64,
    /// About the least length of wall on which the maps must agree, metres. `icp_refiner` measures it exactly, and asks
    /// for more.
    pub min_wall_length: f64,
    /// The side of a cell in the second, finer search round the best place, metres; never less than 1.5 cells of the
    /// coarser map. It is also the standard deviation of the position that is sent.
    pub fine_cell: f64,
    /// The rotations of the finer search lie this far apart, radians. It is also the standard deviation of the rotation
    /// that is sent.
    pub fine_rotation_step: f64,
    /// Whether the guess is marked as provisional: then `icp_refiner` must confirm it by more than it asks of a guess
    /// that rests on tags.
    pub provisional: bool,
    /// A map whose known part is longer than this in x or in y is not aligned, metres: time and memory grow with the
    /// square.
    pub max_extent: f64,
}

impl Default for MapAlignerParameters {
    fn default() -> Self {
        Self {
            cell: 0.2,
            rotation_step: TAU / 360.0,
            free_space_penalty: 0.6,
            apart_yaw: TAU / 36.0,
            apart: 1.0,
            max_runner_up: 0.6,
            min_wall_length: 15.0,
            fine_cell: 0.1,
            fine_rotation_step: TAU / 720.0,
            provisional: true,
            max_extent: 400.0,
        }
    }
}

impl MapAlignerParameters {
    /// The number of rotations that are tried, evenly spread over a full turn.
    pub(super) fn rotations(&self) -> usize {
        (TAU / self.rotation_step - 1e-9).ceil() as usize
    }
}

impl Parameters for MapAlignerParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let ranges = [
            ("cell", self.cell, 0.01, 10.0),
            ("rotation_step", self.rotation_step, 1e-3, PI),
            ("free_space_penalty", self.free_space_penalty, 0.0, 100.0),
            ("apart_yaw", self.apart_yaw, 0.0, PI),
            ("apart", self.apart, 0.0, 1e6),
            ("max_runner_up", self.max_runner_up, 0.0, 1.0),
            ("min_wall_length", self.min_wall_length, 0.0, 1e6),
            ("fine_cell", self.fine_cell, 0.01, 10.0),
            ("fine_rotation_step", self.fine_rotation_step, 1e-4, PI),
            ("max_extent", self.max_extent, 1.0, 1e4),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        // Beyond that, tables of all places do not fit in memory.
        if self.max_extent / self.cell.min(self.fine_cell) > 2e4 {
            errors.push(ParameterError::new("max_extent", "must be at most 20000 cells"));
        }
        errors
    }
}

//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Parameters of the Hough spectrum aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoughSpectrumParameters {
    /// The spectra are taken at directions that lie about so far apart, radians.
    pub rotation_step: f64,
    /// The width of the lines whose cells are counted for the spectra and projections, metres; never less than a cell of
    /// either map.
    pub cell: f64,
    /// So many peaks of the cross-correlation of both spectra are followed up, the highest ones. Each stands for two rotations,
    /// half a turn apart.
    pub rotations: usize,
    /// Peaks nearer to a higher one than this are left out, radians.
    pub apart_yaw: f64,
    /// So many peaks of the cross-correlation of the projections on each axis are followed up. The paper takes the highest.
    pub translations: usize,
    /// Peaks nearer to a higher one than this are left out, metres.
    pub apart: f64,
    /// The least acceptance index omega at which the best place is accepted, 0 to 1. In maps that were drawn from laser scans in six
    /// buildings, pairs that came to lie rightly had 0.97 and more, and maps of different buildings up to 0.951; other maps, of
    /// mostly free space, have more at wrong places.
    pub min_omega: f64,
    /// The least share of the smaller map of which the other must say something, 0 to 1. The paper asks for none, and maps
    /// that share a few cells nearly always agree on them.
    pub min_overlap: f64,
    /// At most so many places are sent for a pair of maps.
    pub max_hypotheses: usize,
    /// A map whose walls are spread over more than this in x or in y is not aligned, metres.
    pub max_extent: f64,
}

impl Default for HoughSpectrumParameters {
    fn default() -> Self {
        Self {
            rotation_step: TAU / 1440.0,
            cell: 0.05,
            rotations: 4,
            apart_yaw: TAU / 72.0,
            translations: 1,
            apart: 1.0,
            min_omega: 0.96,
            min_overlap: 0.1,
            max_hypotheses: 4,
            max_extent: 400.0,
        }
    }
}

impl Parameters for HoughSpectrumParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let ranges = [
            ("rotation_step", self.rotation_step, 1e-4, FRAC_PI_2),
            ("cell", self.cell, 0.01, 10.0),
            ("apart_yaw", self.apart_yaw, 0.0, FRAC_PI_2),
            ("apart", self.apart, 0.0, 1e6),
            ("min_omega", self.min_omega, 0.0, 1.0),
            ("min_overlap", self.min_overlap, 0.0, 1.0),
            ("max_extent", self.max_extent, 1.0, 1e4),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        for (field, value, most) in [
            ("rotations", self.rotations, 100),
            ("translations", self.translations, 100),
            ("max_hypotheses", self.max_hypotheses, 1000),
        ] {
            if !(1..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between 1 and {most}, not {value}")));
            }
        }
        // Beyond that, the cross-correlation of projections takes seconds.
        if self.max_extent / self.cell > 1e4 {
            errors.push(ParameterError::new("max_extent", "must be at most 10000 cells"));
        }
        errors
    }
}

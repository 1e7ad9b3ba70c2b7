//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Parameters of the Hough spectrum aligner. What takes them expects values that have passed
/// [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HoughSpectrumParameters {
    /// Approximate spacing of the directions of the spectra, radians.
    #[schemars(range(min = 1e-4, max = FRAC_PI_2))]
    pub rotation_step: f64,
    /// The width of the lines whose cells are counted for the spectra and projections, metres; never less than a cell
    /// of either map.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub cell: f64,
    /// Number of the highest peaks of the cross-correlation of both spectra that are used. Each gives two rotations,
    /// half a turn apart.
    #[schemars(range(min = 1, max = 100))]
    pub rotations: usize,
    /// Peaks nearer to a higher one than this are left out, radians.
    #[schemars(range(min = 0.0, max = FRAC_PI_2))]
    pub apart_yaw: f64,
    /// Number of peaks of the cross-correlation of the projections on each axis that are used. The paper takes the
    /// highest.
    #[schemars(range(min = 1, max = 100))]
    pub translations: usize,
    /// Peaks nearer to a higher one than this are left out, metres.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// Least acceptance index omega of an accepted pose. In maps that were built from laser scans in six buildings,
    /// right poses had 0.97 and more, and those of different buildings up to 0.951; other maps, of mostly free space,
    /// have more at wrong poses.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_omega: f64,
    /// Least share of the smaller map at which the other must be known. The paper requires none, and maps that share a
    /// few cells nearly always agree on them.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_overlap: f64,
    /// Largest number of hypotheses that are sent for a pair of maps.
    #[schemars(range(min = 1, max = 1000))]
    pub max_hypotheses: usize,
    /// A map whose walls are spread over more than this in x or in y is not aligned, metres.
    #[schemars(range(min = 1.0, max = 1e4))]
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
    fn check_together(&self) -> Vec<ParameterError> {
        // Beyond that, the cross-correlation of projections takes seconds.
        let fits = self.max_extent / self.cell <= 1e4;
        (!fits).then(|| ParameterError::new("max_extent", "must be at most 10000 cells")).into_iter().collect()
    }
}

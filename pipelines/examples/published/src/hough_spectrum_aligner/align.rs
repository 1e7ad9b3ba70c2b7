//! Relative poses of two maps from their spectra.

use super::rotation::{Rotation, rotations};
use super::translation::{Shift, project, shifts};
use super::{HoughSpectrum, HoughSpectrumParameters, WallCells};
use crate::pair_aligner::{RatedPose, known_area};
use gridweave_stages::registration::search::{NamedMap, SearchRefusal};
use gridweave_stages::shared::geometry::{Pose2, quarter_turn};
use nalgebra::{Isometry2, Matrix3, UnitComplex, Vector2, Vector3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Relative poses of map b in map a, in the order in which they were found.
///
/// # Errors
/// A map has no walls, or is too large.
pub fn align_spectra(
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    parameters: &HoughSpectrumParameters,
) -> Result<Vec<RatedPose>, SearchRefusal> {
    let walls_a = WallCells::new(a, parameters.max_extent)?;
    let walls_b = WallCells::new(b, parameters.max_extent)?;
    let cell = parameters.cell.max(a.grid.geometry.resolution).max(b.grid.geometry.resolution);
    let count = (PI / parameters.rotation_step).round().max(1.0) as usize;
    let spectrum_a = HoughSpectrum::new(&walls_a, count, cell);
    let spectrum_b = HoughSpectrum::new(&walls_b, count, cell);
    let found = rotations(&spectrum_a, &spectrum_b, parameters.rotations, parameters.apart_yaw);
    let opposite = |rotation: Rotation| [rotation, Rotation { angle: rotation.angle + PI, ..rotation }];
    let turned: Vec<Rotation> = found.into_iter().flat_map(opposite).collect();

    // Projections are sharp only along the walls: both maps are turned so that most walls of a are along the axes.
    let along = spectrum_a.main_direction();
    let [x_a, y_a] = project(&walls_a, -along, cell);
    let known = known_area(&a.grid).min(known_area(&b.grid));
    let places = turned.par_iter().flat_map_iter(|rotation| {
        let [x_b, y_b] = project(&walls_b, rotation.angle - along, cell);
        let along_x = shifts(&x_a, &x_b, cell, parameters.translations, parameters.apart);
        let along_y = shifts(&y_a, &y_b, cell, parameters.translations, parameters.apart);
        let both = along_x.into_iter().flat_map(move |x| along_y.clone().into_iter().map(move |y| (x, y)));
        both.map(|(x, y)| Place { rotation: *rotation, along, x, y }.on(&walls_a, &walls_b)).collect::<Vec<_>>()
    });
    let places: Vec<(Pose2, Matrix3<f64>)> = places.collect();
    let hypothesis = |(transform, covariance)| RatedPose::new(&a.grid, &b.grid, transform, covariance, known);
    Ok(places.into_par_iter().map(hypothesis).collect())
}

/// A rotation, and the translations along two axes that are turned by `along` from those of map a.
struct Place {
    rotation: Rotation,
    along: f64,
    x: Shift,
    y: Shift,
}

impl Place {
    /// `T_a_b` and its covariance, from the widths of the peaks.
    fn on(&self, a: &WallCells, b: &WallCells) -> (Pose2, Matrix3<f64>) {
        let (turn, axes) = (UnitComplex::new(self.rotation.angle), UnitComplex::new(self.along));
        let middle = turn * b.middle.coords;
        let translation = a.middle.coords + axes * Vector2::new(self.x.metres, self.y.metres) - middle;
        let deviations = Vector3::new(self.x.deviation, self.y.deviation, self.rotation.deviation);
        // The rotation is about the centre of map b, and moves the origin of its frame.
        let arm = -quarter_turn(&middle);
        let axes = axes.to_rotation_matrix().into_inner();
        let jacobian = Matrix3::new(axes.m11, axes.m12, arm.x, axes.m21, axes.m22, arm.y, 0.0, 0.0, 1.0);
        let covariance =
            jacobian * Matrix3::from_diagonal(&deviations.map(|deviation| deviation.powi(2))) * jacobian.transpose();
        (Isometry2::from_parts(translation.into(), turn), covariance)
    }
}

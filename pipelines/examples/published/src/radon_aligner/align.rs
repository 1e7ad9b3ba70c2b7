//! Rotation, four hypotheses, translation and similarity.

use super::{Profile, QuarterEnergy, RadonAlignerParameters, RadonRefusal, RotationPeak, Shift, WallPoints, energy};
use crate::acceptance_index::AcceptanceIndex;
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Point2, Pose2, covariance_about, is_known, pose};
use nalgebra::{Matrix2, Matrix3, Rotation2, UnitComplex, Vector2};
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Approximate number of known cells of map b by which many poses are compared.
const SAMPLE: usize = 6000;

/// Data of one map.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedMap {
    points: WallPoints,
    energy: QuarterEnergy,
    known: usize,
}

/// Relative pose of two maps.
#[derive(Clone, Debug, PartialEq)]
pub struct RadonAlignment {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians: yaw from the width of the peak over the angle, the position of
    /// the centroid of b's walls from those of the two profiles' peaks.
    pub covariance: Matrix3<f64>,
    /// Correlation of the directions.
    pub peak: RotationPeak,
    /// The acceptance index at the transform, 0 to 1.
    pub similarity: f64,
    /// Acceptance indices of the four hypotheses at their best poses, by the number of quarter turns; 0 where a
    /// hypothesis has no pose with enough in common.
    pub similarities: [f64; 4],
}

impl PreparedMap {
    /// The Radon energy of a map.
    pub fn new(grid: &Grid<'_>, steps: usize) -> Self {
        let points = WallPoints::of(grid);
        let energy = QuarterEnergy::new(&energy(&points, steps));
        Self { energy, points, known: grid.cells.iter().filter(|value| is_known(**value)).count() }
    }

    /// The energy of the Radon transform over the angle, in the frame of the grid.
    pub fn energy(&self) -> &QuarterEnergy {
        &self.energy
    }
}

impl RadonAlignment {
    /// Reason for the user.
    pub fn reason(&self) -> String {
        let mut others = self.similarities.to_vec();
        others.sort_by(|one, other| other.total_cmp(one));
        let next = others.get(1).copied().unwrap_or_default();
        format!(
            "the directions of the walls: they fit with a correlation of {:.2}; the maps agree on {:.2} of what they have in \
             common, and on {next:.2} at the next best of four rotations",
            self.peak.correlation, self.similarity
        )
    }
}

/// A map with its name and data.
#[derive(Clone, Copy, Debug)]
pub struct NamedMap<'a> {
    /// Name of the robot.
    pub robot: &'a str,
    /// Its cells.
    pub grid: Grid<'a>,
    /// Its data, with the same number of angles for all maps.
    pub prepared: &'a PreparedMap,
}

/// Aligns map b with map a.
///
/// # Errors
/// A map has no walls or is too large, the directions of the walls do not fit, or the maps have too little in common
/// or agree on too little of it at the best pose.
pub fn align(
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    parameters: &RadonAlignerParameters,
) -> Result<RadonAlignment, RadonRefusal> {
    for map in [a, b] {
        let robot = || map.robot.to_owned();
        if map.prepared.points.is_empty() {
            return Err(RadonRefusal::NoWalls { robot: robot() });
        }
        if map.prepared.points.extent() * map.grid.geometry.resolution > parameters.max_extent {
            return Err(RadonRefusal::TooLarge { robot: robot(), most: parameters.max_extent });
        }
    }
    let least = parameters.min_correlation;
    let peak = a.prepared.energy.rotation_of(&b.prepared.energy);
    let peak = peak.ok_or(RadonRefusal::NoRotation { correlation: 0.0, least })?;
    if peak.correlation < least {
        return Err(RadonRefusal::NoRotation { correlation: peak.correlation, least });
    }
    let sample = Sample::of(&b.grid, b.prepared.known);
    let places: Vec<Option<Place>> =
        (0..4).into_par_iter().map(|turns| best_place(turns, &peak, a, b, &sample.grid(), parameters)).collect();
    let similarities = std::array::from_fn(|turns| places[turns].as_ref().map_or(0.0, |place| place.similarity));
    // Of equals the first.
    let better = |best: Option<Place>, one: Place| match best {
        Some(best) if best.similarity >= one.similarity => Some(best),
        _ => Some(one),
    };
    let best = places.into_iter().flatten().fold(None, better);
    let best = best.ok_or(RadonRefusal::NoOverlap { percent: 100.0 * parameters.min_overlap })?;
    if best.similarity < parameters.min_similarity {
        return Err(RadonRefusal::Dissimilar { similarity: best.similarity, least: parameters.min_similarity });
    }
    Ok(RadonAlignment {
        covariance: best.covariance(&peak, b),
        transform_a_b: best.transform_a_b,
        peak,
        similarity: best.similarity,
        similarities,
    })
}

/// The best pose at one of the four rotations.
#[derive(Clone, Debug)]
struct Place {
    transform_a_b: Pose2,
    similarity: f64,
    /// Direction of the first of the two axes of the walls, in the frame of map a.
    axis: UnitComplex<f64>,
    /// The deviations along both axes, metres.
    deviations: [f64; 2],
}

impl Place {
    /// Covariance of the transform. The centroid of b's walls is as uncertain as the profiles are; the frame's origin
    /// is farther away from there.
    fn covariance(&self, peak: &RotationPeak, b: &NamedMap<'_>) -> Matrix3<f64> {
        let points = b.prepared.points.points();
        let count = points.len().max(1) as f64;
        let middle = Point2::from(points.fold(Vector2::zeros(), |sum, point| sum + point.coords) / count);
        let geometry = &b.grid.geometry;
        let middle_b = geometry.origin * (middle * geometry.resolution);
        let turn: Rotation2<f64> = self.axis.into();
        let variances = Matrix2::from_diagonal(&Vector2::from(self.deviations.map(|deviation| deviation.powi(2))));
        let of_middle = turn.matrix() * variances * turn.matrix().transpose();
        covariance_about(&self.transform_a_b, &middle_b, &of_middle, peak.deviation.powi(2))
    }
}

/// The pose at which the maps agree best at one of the four rotations, if they have enough in common anywhere.
fn best_place(
    turns: usize,
    peak: &RotationPeak,
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    sample: &Grid<'_>,
    parameters: &RadonAlignerParameters,
) -> Option<Place> {
    let (geometry_a, geometry_b) = (&a.grid.geometry, &b.grid.geometry);
    let rotation = UnitComplex::new(peak.rotation + turns as f64 * FRAC_PI_2);
    // All in the frame of grid a, with the rotation of grid b known and its corner at the origin.
    let axis = UnitComplex::new(a.prepared.energy.main_direction());
    let extent = [a, b].map(|map| map.prepared.points.extent() * map.grid.geometry.resolution);
    let bin = geometry_a.resolution.max(geometry_b.resolution).max(Profile::least_bin(extent[0].max(extent[1])));
    let shifts: [Vec<Shift>; 2] = [0.0, FRAC_PI_2].map(|across| {
        let direction = axis * UnitComplex::new(across);
        let along_a = direction.inverse();
        let along_b = direction.inverse() * rotation;
        let a_places = a.prepared.points.points().map(|point| (along_a * point).x * geometry_a.resolution);
        let b_places = b.prepared.points.points().map(|point| (along_b * point).x * geometry_b.resolution);
        Profile::new(a_places, bin).shifts(&Profile::new(b_places, bin), parameters.shifts)
    });
    let transform = |x: &Shift, y: &Shift| {
        let translation = axis * Vector2::new(x.metres, y.metres);
        let grids = Pose2::from_parts(translation.into(), rotation);
        geometry_a.origin * grids * geometry_b.origin.inverse()
    };
    let smaller = (a.prepared.known as f64 * (geometry_a.resolution / geometry_b.resolution).powi(2))
        .min(b.prepared.known as f64);
    let share_sampled = (geometry_b.resolution / sample.geometry.resolution).powi(2);
    let enough = |index: &AcceptanceIndex, share: f64| {
        index.known_in_both() > 0 && index.known_in_both() as f64 >= parameters.min_overlap * smaller * share
    };
    let mut best: Option<(AcceptanceIndex, &Shift, &Shift)> = None;
    for x in &shifts[0] {
        for y in &shifts[1] {
            let index = AcceptanceIndex::new(&a.grid, sample, &transform(x, y));
            if enough(&index, share_sampled) && best.is_none_or(|(best, ..)| index.omega() > best.omega()) {
                best = Some((index, x, y));
            }
        }
    }
    let (_, x, y) = best?;
    let transform_a_b = transform(x, y);
    let index = AcceptanceIndex::new(&a.grid, &b.grid, &transform_a_b);
    enough(&index, 1.0).then(|| Place {
        transform_a_b,
        similarity: index.omega(),
        axis: geometry_a.origin.rotation * axis,
        deviations: [x.deviation, y.deviation],
    })
}

/// A map of fewer cells, each with the value of the cell at its centre.
struct Sample {
    geometry: GridGeometry,
    cells: Vec<i8>,
}

impl Sample {
    /// Every so many cells of a grid, so that about [`SAMPLE`] of those that are known are left.
    fn of(grid: &Grid<'_>, known: usize) -> Self {
        let stride = ((known as f64 / SAMPLE as f64).sqrt().ceil() as usize).max(1);
        let first = stride / 2;
        let GridGeometry { width, height, resolution, origin } = grid.geometry;
        let rows = grid.cells.chunks(width.max(1)).skip(first).step_by(stride);
        let cells: Vec<i8> = rows.flat_map(|row| row.iter().skip(first).step_by(stride).copied()).collect();
        let count = |cells: usize| cells.saturating_sub(first).div_ceil(stride);
        // The middle of a cell of the sample is that of the cell that it stands for.
        let back = (first as f64 + 0.5 - 0.5 * stride as f64) * resolution;
        let geometry = GridGeometry {
            width: count(width),
            height: count(height),
            resolution: resolution * stride as f64,
            origin: origin * pose(back, back, 0.0),
        };
        Self { geometry, cells }
    }

    fn grid(&self) -> Grid<'_> {
        Grid { geometry: self.geometry, cells: &self.cells }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_stages::shared::geometry::{Cell, UNKNOWN};

    #[test]
    fn the_middles_of_sampled_cells_are_those_of_cells_of_the_map() {
        let geometry = GridGeometry { width: 403, height: 298, resolution: 0.05, origin: pose(3.0, -1.0, 0.4) };
        let cells: Vec<i8> = (0..geometry.cell_count()).map(|index| (index % 101) as i8).collect();
        let grid = Grid::new(geometry, &cells).unwrap();
        let sample = Sample::of(&grid, cells.len());
        assert!(Grid::new(sample.geometry, &sample.cells).is_ok() && sample.cells.len() < SAMPLE + 500);
        for row in 0..sample.geometry.height {
            for column in 0..sample.geometry.width {
                let cell = Cell { column, row };
                assert_eq!(sample.grid().value(cell), grid.value_at(&sample.geometry.centre(cell)), "{cell:?}");
            }
        }
        let small = Grid::new(GridGeometry { width: 2, height: 1, ..geometry }, &[100, UNKNOWN]).unwrap();
        assert_eq!(Sample::of(&small, 1).cells, [100, UNKNOWN]);
    }
}

//! How well two maps agree where both know something.

use super::{IcpParameters, WallMap};
use crate::geometry::{Grid, Pose2, is_free};

/// The fewest cells of the coarser map within which two walls agree.
const LEAST_TOLERANCE: f64 = 1.5;

/// What two maps say of each other at one alignment, both ways together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Area that both maps know, square metres.
    pub overlap: f64,
    /// Area that both maps call free, square metres.
    pub free_on_free: f64,
    /// Length of wall of one map that lies on wall of the other, metres, mean of both ways.
    pub wall_on_wall: f64,
    /// Length of wall of one map that lies where the other knows free space, far from any wall, metres, mean of both
    /// ways.
    pub wall_on_free: f64,
}

impl Agreement {
    /// The share of the walls that both maps have seen on which they agree, 0 to 1; 0 without any.
    pub fn wall_agreement(&self) -> f64 {
        share(self.wall_on_wall, self.wall_on_free)
    }
}

fn share(agree: f64, disagree: f64) -> f64 {
    let all = agree + disagree;
    if all > 0.0 { agree / all } else { 0.0 }
}

/// One map and its cells.
#[derive(Clone, Copy, Debug)]
pub struct MapView<'a> {
    /// Its cells.
    pub grid: Grid<'a>,
    /// Its walls.
    pub walls: &'a WallMap,
}

/// Compares two maps at an alignment.
pub fn compare(a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2, parameters: &IcpParameters) -> Agreement {
    let resolution = a.grid.geometry.resolution.max(b.grid.geometry.resolution);
    let tolerance = parameters.wall_tolerance.max(LEAST_TOLERANCE * resolution);
    let (agree_b, against_b) = walls_on(a, b.walls, transform_a_b, tolerance);
    let (agree_a, against_a) = walls_on(b, a.walls, &transform_a_b.inverse(), tolerance);
    let (mut known, mut free) = (0usize, 0usize);
    for sample in &b.walls.samples {
        let value = value_at(&a.grid, &(transform_a_b * sample.point));
        known += usize::from(value >= 0);
        free += usize::from(sample.free && is_free(value));
    }
    Agreement {
        overlap: known as f64 * b.walls.sample_area,
        free_on_free: free as f64 * b.walls.sample_area,
        wall_on_wall: (agree_a + agree_b) / 2.0,
        wall_on_free: (against_a + against_b) / 2.0,
    }
}

/// Metres of the walls of `other` that lie on walls of `map`, and on its free space.
fn walls_on(map: &MapView<'_>, other: &WallMap, transform_map_other: &Pose2, tolerance: f64) -> (f64, f64) {
    let (mut agree, mut against) = (0usize, 0usize);
    for point in other.walls.points() {
        let point = transform_map_other * point;
        if map.walls.walls.nearest(&point, tolerance).is_some() {
            agree += 1;
        } else if is_free(value_at(&map.grid, &point)) {
            against += 1;
        }
    }
    (agree as f64 * other.spacing, against as f64 * other.spacing)
}

fn value_at(grid: &Grid<'_>, point: &crate::geometry::Point2) -> i8 {
    grid.geometry.cell(point).map_or(crate::geometry::UNKNOWN, |cell| grid.value(cell))
}

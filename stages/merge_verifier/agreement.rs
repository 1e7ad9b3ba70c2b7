//! How well two maps agree where both know something.

use super::MergeVerifierParameters;
use crate::geometry::{Grid, Point2, Pose2, UNKNOWN, is_free, is_known};
use crate::walls::{WallMap, stride};
use nalgebra::Vector2;

/// Two walls that lie within this many cells of the coarser map of each other may be the same one, drawn in other
/// cells.
const LEAST_TOLERANCE: f64 = 1.5;

/// A map: its cells, and what was made of them.
#[derive(Clone, Copy, Debug)]
pub struct MapView<'a> {
    /// Its cells.
    pub grid: Grid<'a>,
    /// Its walls and the samples of its known space.
    pub walls: &'a WallMap,
}

/// What two maps say of each other at one alignment.
///
/// Lengths are the mean of both ways: walls of b looked up in a, and walls of a looked up in b.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Area that both maps know, square metres.
    pub overlap: f64,
    /// Area that both maps call free, square metres.
    pub free_on_free: f64,
    /// Length of wall of one map that lies on wall of the other, metres.
    pub wall_on_wall: f64,
    /// Length of wall of one map that lies where the other knows free space, farther from any wall than the tolerance,
    /// metres.
    pub wall_on_free: f64,
    /// Square metres that a metre of wall covers: the side of a cell.
    pub wall_width: f64,
    /// The middle of the walls of map b that lie on walls of map a, frame a; the origin if there are none.
    pub centre: Point2,
}

impl Agreement {
    /// The share of the walls that both maps have seen on which they agree, 0 to 1; 0 if there are none.
    ///
    /// This is what tells right alignments from wrong ones: free space, of which maps have most, lies on free space
    /// wherever one lays it.
    pub fn wall_agreement(&self) -> f64 {
        share(self.wall_on_wall, self.wall_on_free)
    }

    /// Length of wall of one map of which the other knows what is there, metres.
    pub fn wall_seen(&self) -> f64 {
        self.wall_on_wall + self.wall_on_free
    }

    /// Metres of wall that speak for an alignment when those on free space count `penalty` times against it. Above 0 only
    /// where more speaks for it than against it.
    pub fn evidence(&self, penalty: f64) -> f64 {
        (self.wall_on_wall - penalty * self.wall_on_free).max(0.0)
    }

    /// The acceptance index omega of Birk and Carpin (2006): agree / (agree + disagree) over what both maps know, 0 to
    /// 1.
    pub fn acceptance_index(&self) -> f64 {
        share(self.free_on_free + self.wall_on_wall * self.wall_width, self.wall_on_free * self.wall_width)
    }
}

fn share(agree: f64, disagree: f64) -> f64 {
    let all = agree + disagree;
    if all > 0.0 { agree / all } else { 0.0 }
}

/// Compares two maps at an alignment.
pub fn compare(
    a: &MapView<'_>,
    b: &MapView<'_>,
    transform_a_b: &Pose2,
    parameters: &MergeVerifierParameters,
) -> Agreement {
    compare_sampled(a, b, transform_a_b, parameters, usize::MAX)
}

/// Compares two maps at an alignment by samples of at most so many points of the walls and of known space each.
pub fn compare_sampled(
    a: &MapView<'_>,
    b: &MapView<'_>,
    transform_a_b: &Pose2,
    parameters: &MergeVerifierParameters,
    most_points: usize,
) -> Agreement {
    let coarser = a.grid.geometry.resolution.max(b.grid.geometry.resolution);
    let tolerance = parameters.wall_tolerance.max(LEAST_TOLERANCE * coarser);
    let of_b = walls_on(a, b.walls, transform_a_b, tolerance, most_points);
    let of_a = walls_on(b, a.walls, &transform_a_b.inverse(), tolerance, most_points);
    let (mut known, mut free) = (0usize, 0usize);
    let stride = stride(b.walls.samples.len(), most_points);
    let area = stride as f64 * b.walls.sample_area;
    for sample in b.walls.samples.iter().step_by(stride) {
        let value = value_at(&a.grid, &(transform_a_b * sample.point));
        known += usize::from(is_known(value));
        free += usize::from(sample.free && is_free(value));
    }
    Agreement {
        overlap: known as f64 * area,
        free_on_free: free as f64 * area,
        wall_on_wall: (of_a.on_wall + of_b.on_wall) / 2.0,
        wall_on_free: (of_a.on_free + of_b.on_free) / 2.0,
        wall_width: (a.grid.geometry.resolution + b.grid.geometry.resolution) / 2.0,
        centre: of_b.centre,
    }
}

/// Metres of one map's walls, by what the other map knows there.
struct WallLengths {
    on_wall: f64,
    on_free: f64,
    /// The middle of what lies on walls, in the frame of the map it is looked up in.
    centre: Point2,
}

fn walls_on(
    map: &MapView<'_>,
    other: &WallMap,
    transform_map_other: &Pose2,
    tolerance: f64,
    most_points: usize,
) -> WallLengths {
    let (mut on_wall, mut on_free, mut sum) = (0usize, 0usize, Vector2::zeros());
    let stride = stride(other.walls.points().len(), most_points);
    for point in other.walls.points().iter().step_by(stride) {
        let point = transform_map_other * point;
        // The cell is cheaper to look at than the walls, and most walls of one map are unknown to the other.
        let value = value_at(&map.grid, &point);
        if !is_known(value) {
            continue;
        }
        if map.walls.walls.nearest(&point, tolerance).is_some() {
            on_wall += 1;
            sum += point.coords;
        } else if is_free(value) {
            on_free += 1;
        }
    }
    let length = stride as f64 * other.spacing;
    let centre = Point2::from(sum / on_wall.max(1) as f64);
    WallLengths { on_wall: on_wall as f64 * length, on_free: on_free as f64 * length, centre }
}

pub(super) fn value_at(grid: &Grid<'_>, point: &Point2) -> i8 {
    grid.geometry.cell(point).map_or(UNKNOWN, |cell| grid.value(cell))
}

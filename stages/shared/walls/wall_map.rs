//! Walls and known space of one map, for registration and verification.

use super::extents::{WallExtent, extents};
use super::stride;
use super::wall_line::{CellRows, LineFit, Window};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Cell, Grid, Point2, PointIndex, is_free, is_known, is_occupied};
use nalgebra::Vector2;

/// Distance between the samples of known space, metres.
const SAMPLE_SPACING: f64 = 0.2;
/// Most points of walls, more than those of any published map of a building, and most samples of known space: the
/// memory and the time of a comparison go with them. Beyond it only some are taken, evenly.
const MOST_POINTS: usize = 1 << 20;
const MOST_SAMPLES: usize = 1 << 24;
/// Side of a bucket of wall points, metres: near the last search radius of a registration, so that nine buckets
/// contain the answer.
const BUCKET_SIDE: f64 = 0.2;
/// Most unknown cells in a row between a wall and the space before it: RTAB-Map leaves one or two, and so does the
/// fringe of a wall whose grey values are neither free nor occupied.
const MOST_UNKNOWN: isize = 2;

/// A map's walls as points with normals, and samples of its known space.
#[derive(Clone, Debug)]
pub struct WallMap {
    /// The walls: one point for each occupied cell that faces known space, or for some of very many, moved onto the
    /// line through its neighbours.
    pub walls: PointIndex,
    /// Unit normals of the walls, in the order of the index; zero where the neighbours show no line.
    pub normals: Vec<Vector2<f64>>,
    /// How large the things are that the points belong to, in the order of the index.
    pub extents: Vec<WallExtent>,
    /// Length of wall per point, metres.
    pub spacing: f64,
    /// Known space, sampled evenly.
    pub samples: Vec<KnownSample>,
    /// Area per sample, square metres.
    pub sample_area: f64,
}

/// A point whose occupancy is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownSample {
    /// Position, metres, map frame.
    pub point: Point2,
    /// Whether it is free of obstacles.
    pub free: bool,
}

impl WallMap {
    /// Extracts the walls of a grid. A wall's direction is estimated from the wall cells within `normal_radius`
    /// metres, and at least from the cells two away.
    pub fn new(grid: &Grid<'_>, normal_radius: f64) -> Self {
        let resolution = grid.geometry.resolution;
        let cells = grid.occupied().filter(|cell| faces_known_space(grid, *cell));
        let rows = CellRows::new(cells, grid.geometry.height);
        let step = stride(rows.len(), MOST_POINTS);
        let spacing = resolution * step as f64;
        let window = Window::new(normal_radius / resolution);
        let fits: Vec<LineFit> = rows.cells().step_by(step).map(|cell| window.fit(&rows, cell)).collect();
        let points: Vec<Point2> = fits.iter().map(|fit| grid.geometry.origin * (fit.point * resolution)).collect();
        let (walls, order) = PointIndex::new(&points, BUCKET_SIDE);
        let normals: Vec<_> = order.iter().map(|&i| grid.geometry.origin.rotation * fits[i].normal).collect();
        let extents = extents(&walls, &normals, spacing);
        let (samples, sample_area) = known_samples(grid);
        Self { walls, normals, extents, spacing, samples, sample_area }
    }

    /// The same walls and samples, displaced by a deformation. Its turns are so small that the normals stay.
    #[must_use]
    pub fn deformed(&self, deformation: &Deformation) -> Self {
        let moved: Vec<Point2> = self.walls.points().iter().map(|point| deformation.apply(point)).collect();
        let (walls, order) = PointIndex::new(&moved, BUCKET_SIDE);
        let normals = order.iter().map(|&i| self.normals[i]).collect();
        let extents = order.iter().map(|&i| self.extents[i]).collect();
        let samples =
            self.samples.iter().map(|sample| KnownSample { point: deformation.apply(&sample.point), ..*sample });
        Self { walls, normals, extents, samples: samples.collect(), ..*self }
    }
}

/// Whether a cell faces known free space. The inside of a thick wall, and its far side that no robot has seen, are no
/// measurement of the wall's face. Some mappers leave cells unknown before a wall; these are skipped.
fn faces_known_space(grid: &Grid<'_>, cell: Cell) -> bool {
    let directions = (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y))).filter(|direction| *direction != (0, 0));
    let mut directions = directions.map(|(x, y): (isize, isize)| {
        let ahead = |step: isize| {
            let column = cell.column.checked_add_signed(step * x)?;
            Some(grid.value(Cell { column, row: cell.row.checked_add_signed(step * y)? }))
        };
        (1..=MOST_UNKNOWN + 1).map_while(ahead).find(|value| is_known(*value))
    });
    directions.any(|met| met.is_some_and(|value| !is_occupied(value)))
}

/// Known cells at about [`SAMPLE_SPACING`], and the area per sample.
fn known_samples(grid: &Grid<'_>) -> (Vec<KnownSample>, f64) {
    let resolution = grid.geometry.resolution;
    let least = (grid.geometry.cell_count() as f64 / MOST_SAMPLES as f64).sqrt().ceil().max(1.0);
    let stride = (SAMPLE_SPACING / resolution).round().clamp(least, 1e6) as usize;
    let (width, height) = (grid.geometry.width, grid.geometry.height);
    let mut samples = Vec::new();
    for row in (stride / 2..height).step_by(stride) {
        for column in (stride / 2..width).step_by(stride) {
            let cell = Cell { column, row };
            let value = grid.value(cell);
            if is_known(value) {
                samples.push(KnownSample { point: grid.geometry.centre(cell), free: is_free(value) });
            }
        }
    }
    let side = stride as f64 * resolution;
    (samples, side * side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, UNKNOWN, pose};

    const SIDE: usize = 60;

    /// A grid with the values of `value` at points (x, y), both in cells.
    fn map_of(value: impl Fn(f64, f64) -> i8) -> WallMap {
        let geometry = GridGeometry { width: SIDE, height: SIDE, resolution: 0.05, origin: pose(1.0, 2.0, 0.3) };
        let cells: Vec<i8> =
            (0..SIDE * SIDE).map(|i| value((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5)).collect();
        WallMap::new(&Grid::new(geometry, &cells).unwrap(), 0.2)
    }

    #[test]
    fn points_of_a_slanted_wall_lie_on_its_line_and_not_on_cell_centres() {
        let normal = Vector2::new(-f64::sin(0.4), f64::cos(0.4));
        let across = |x: f64, y: f64| normal.dot(&Vector2::new(x - 30.0, y - 30.0));
        let map = map_of(|x, y| if across(x, y).abs() <= 0.7 { 100 } else { 0 });
        let transform = pose(1.0, 2.0, 0.3);
        let (mut worst, mut inside) = (0.0_f64, 0);
        for (point, found) in map.walls.points().iter().zip(&map.normals) {
            let cell = transform.inverse() * point / 0.05;
            // At the border of the grid the neighbours are to one side only.
            if (8.0..52.0).contains(&cell.x) && (8.0..52.0).contains(&cell.y) {
                inside += 1;
                worst = worst.max(across(cell.x, cell.y).abs());
                assert!(found.dot(&(transform.rotation * normal)).abs() > 0.98, "{found}");
            }
        }
        assert!(inside > 40);
        assert!(worst < 0.25, "{worst} cells");
    }

    #[test]
    fn the_inside_of_a_thick_wall_and_its_unseen_side_are_left_out() {
        let map = map_of(|x, _| match x {
            x if x < 20.0 => 0,
            x if x < 30.0 => 100,
            _ => UNKNOWN,
        });
        assert_eq!(map.walls.points().len(), SIDE);
        let transform = pose(1.0, 2.0, 0.3).inverse();
        for point in map.walls.points() {
            assert!(((transform * point).x / 0.05 - 20.5).abs() < 1e-9);
        }
    }

    #[test]
    fn unknown_cells_before_a_wall_do_not_hide_its_face() {
        let map = map_of(|x, _| match x {
            x if x < 20.0 => 0,
            x if x < 22.0 => UNKNOWN,
            x if x < 25.0 => 100,
            _ => UNKNOWN,
        });
        assert_eq!(map.walls.points().len(), SIDE);
        let transform = pose(1.0, 2.0, 0.3).inverse();
        assert!(map.walls.points().iter().all(|point| ((transform * point).x / 0.05 - 22.5).abs() < 1e-9));
    }

    #[test]
    fn a_single_cell_has_no_direction() {
        let map = map_of(|x, y| if x == 30.5 && y == 30.5 { 100 } else { 0 });
        assert_eq!(map.normals, [Vector2::zeros()]);
    }

    #[test]
    fn of_very_many_walls_some_stand_for_all() {
        let (width, height) = (2_100, 1_000);
        let geometry = GridGeometry { width, height, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) };
        let cells: Vec<i8> = (0..width * height).map(|index| if index % 2 == 0 { 100 } else { 0 }).collect();
        let map = WallMap::new(&Grid::new(geometry, &cells).unwrap(), 0.1);
        let points = map.walls.points().len();
        assert!(points <= MOST_POINTS, "{points}");
        let length = points as f64 * map.spacing;
        assert!((length - 0.05 * (width * height / 2) as f64).abs() < 1.0, "{length} m");
    }

    #[test]
    fn samples_cover_the_known_area() {
        let map = map_of(|x, _| if x < 40.0 { 0 } else { UNKNOWN });
        let area = map.samples.len() as f64 * map.sample_area;
        assert!((area - 2.0 * 3.0).abs() < 1e-9, "{area}");
        assert!(map.samples.iter().all(|sample| sample.free));
    }
}

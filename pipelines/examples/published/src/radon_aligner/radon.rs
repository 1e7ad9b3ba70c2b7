//! The Radon transform of a map's occupied cells, and its energy over the angle.

use gridweave_stages::shared::geometry::{Cell, Grid, Point2};
use nalgebra::Vector2;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Bins for each cell along a projection. They are smoothed to a tent a cell wide on both sides.
const BINS_PER_CELL: f32 = 2.0;

/// The steps of a sequence of places that fill a square evenly (Roberts 2018: powers of the inverse of the plastic
/// number).
const SPREAD: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// As many points are projected before they are counted.
const BLOCK: usize = 256;

/// A point in each occupied cell of a grid, in cells along its axes, from the middle of the rectangle round them.
///
/// A cell is a square, and not the point in its middle: the points lie anywhere in their cells, evenly spread. If all
/// lay in the middle, their lattice would show as directions of walls, along the grid and across its diagonals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WallPoints {
    x: Vec<f32>,
    y: Vec<f32>,
    /// The distance of the farthest point a projection can have.
    reach: f32,
    middle: Vector2<f64>,
}

impl WallPoints {
    /// The occupied cells of a grid.
    pub fn of(grid: &Grid<'_>) -> Self {
        let in_cell = |number: usize| SPREAD.map(|step| (0.5 + number as f64 * step).fract());
        let point = |(number, cell): (usize, Cell)| {
            let [x, y] = in_cell(number);
            Vector2::new(cell.column as f64 + x, cell.row as f64 + y)
        };
        let cells: Vec<Vector2<f64>> = grid.occupied().enumerate().map(point).collect();
        let Some(first) = cells.first() else { return Self::default() };
        let (low, high) = cells.iter().fold((*first, *first), |(low, high), cell| (low.inf(cell), high.sup(cell)));
        let middle = (low + high) / 2.0;
        let (x, y) = cells.iter().map(|cell| ((cell.x - middle.x) as f32, (cell.y - middle.y) as f32)).unzip();
        Self { x, y, reach: (0.5 * (high - low).norm()) as f32, middle }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// The length of the rectangle round all points from corner to corner, in cells.
    pub fn extent(&self) -> f64 {
        f64::from(2.0 * self.reach)
    }

    /// The points, in cells from the corner of the grid.
    pub fn points(&self) -> impl ExactSizeIterator<Item = Point2> + Clone + '_ {
        let point = |(x, y): (&f32, &f32)| Point2::new(f64::from(*x), f64::from(*y)) + self.middle;
        self.x.iter().zip(&self.y).map(point)
    }
}

/// The energy of the Radon transform at `steps` angles over a quarter turn, of each of which that across it is part:
/// the sum over both projections of the square of what lies in a bin. The angle is that of the normal of a wall, and at
/// once the direction of the walls across it; in units of no meaning.
pub fn energy(points: &WallPoints, steps: usize) -> Vec<f64> {
    if points.is_empty() {
        return vec![0.0; steps];
    }
    let bins = (BINS_PER_CELL * 2.0 * points.reach) as usize + 4;
    let at = |histograms: &mut [Vec<u32>; 2], step: usize| {
        let (sin, cos) = (step as f64 * FRAC_PI_2 / steps as f64).sin_cos();
        project(points, (cos as f32, sin as f32), histograms);
        let squares: u64 = histograms.iter().map(|histogram| smoothed_squares(histogram)).sum();
        squares as f64
    };
    let with_histograms = || [vec![0; bins], vec![0; bins]];
    (0..steps).into_par_iter().map_init(with_histograms, at).collect()
}

/// Counts the points by their distance along the given direction and across it.
fn project(points: &WallPoints, (cos, sin): (f32, f32), histograms: &mut [Vec<u32>; 2]) {
    histograms.iter_mut().for_each(|histogram| histogram.fill(0));
    let [along, across] = histograms;
    let (cos, sin) = (BINS_PER_CELL * cos, BINS_PER_CELL * sin);
    // One bin stays empty on both ends.
    let offset = BINS_PER_CELL * points.reach + 1.5;
    let mut places = [(0u32, 0u32); BLOCK];
    for (x, y) in points.x.chunks(BLOCK).zip(points.y.chunks(BLOCK)) {
        for ((place, x), y) in places.iter_mut().zip(x).zip(y) {
            *place = ((x * cos + y * sin + offset) as u32, (y * cos - x * sin + offset) as u32);
        }
        for &(u, v) in &places[..x.len()] {
            if let (Some(u), Some(v)) = (along.get_mut(u as usize), across.get_mut(v as usize)) {
                *u += 1;
                *v += 1;
            }
        }
    }
}

/// The sum of the squares of a histogram whose bins are blurred by 1, 2, 1. In whole numbers, so that it is exact.
fn smoothed_squares(histogram: &[u32]) -> u64 {
    let blurred = histogram.windows(3).map(|near| u64::from(near[0]) + 2 * u64::from(near[1]) + u64::from(near[2]));
    blurred.map(|value| value * value).sum()
}

//! A map convolved with a Gaussian that is another at every place.

use super::padded_field::PaddedField;
use super::{Kernel, PointCovariance};
use gridweave_stages::shared::geometry::{Cell, GridGeometry};
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

/// Cells along the side of a tile, which has one covariance.
pub const TILE: usize = 8;
/// Least standard deviation, in cells, at which the kernel is applied to cells twice as wide: it is as smooth there as
/// a kernel of half as many is on the cells themselves.
const WIDE: f64 = 4.0;

/// Convolves a map in log-odds, on cells of `geometry` in the world, with the kernel of each tile (algorithm 1, step
/// 6).
///
/// `log_odds` and `blurred` have the cells of `geometry`, row by row. Where nothing is said within the reach of a
/// kernel, the result is 0.
pub fn convolve(log_odds: &[f32], geometry: &GridGeometry, covariance: &PointCovariance, blurred: &mut [f32]) {
    let (width, height) = (geometry.width, geometry.height);
    if width == 0 || height == 0 {
        return;
    }
    let corners = [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)];
    let corners = corners.map(|(column, row)| geometry.centre(Cell { column, row }));
    let deviation = covariance.greatest_deviation(&corners) / geometry.resolution;
    let fine = PaddedField::new(log_odds, geometry, deviation);
    let coarse = (deviation >= WIDE).then(|| PaddedField::coarse(log_odds, geometry, deviation));
    let known = KnownTiles::of(log_odds, geometry);
    blurred.par_chunks_mut(width * TILE).enumerate().for_each_init(Kernel::default, |kernel, (tile_row, rows)| {
        for tile_column in 0..width.div_ceil(TILE) {
            let tile = Tile { rows: &mut *rows, width, column: tile_column, row: tile_row };
            let covariance = covariance_of_tile(geometry, covariance, tile_column, tile_row);
            let deviation = covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
            if !known.within(tile_column, tile_row, Kernel::reach(deviation)) {
                continue;
            }
            match &coarse {
                Some(coarse) if covariance.symmetric_eigenvalues().min() >= WIDE * WIDE => {
                    tile.convolve_on_coarse_cells(coarse, kernel, &covariance);
                }
                _ => tile.convolve(&fine, kernel, &covariance),
            }
        }
    });
}

/// A tile of the result.
struct Tile<'a> {
    /// All rows that the tile has a part in.
    rows: &'a mut [f32],
    /// Cells of a row.
    width: usize,
    column: usize,
    row: usize,
}

impl Tile<'_> {
    fn convolve(self, field: &PaddedField, kernel: &mut Kernel, covariance: &Matrix2<f64>) {
        kernel.set(covariance, &Vector2::zeros());
        let first = self.column * TILE;
        for (row, cells) in (self.row * TILE..).zip(self.rows.chunks_mut(self.width)) {
            let sums = field.convolved::<TILE>(kernel, first, row);
            cells[first..].iter_mut().zip(sums).for_each(|(cell, sum)| *cell = sum);
        }
    }

    /// The same on a field of cells twice as wide. Cells that lie at the same place in a wide one have a kernel in
    /// common.
    fn convolve_on_coarse_cells(self, field: &PaddedField, kernel: &mut Kernel, covariance: &Matrix2<f64>) {
        const HALF: usize = TILE / 2;
        // A mean of two cells adds the variance of where they lie to the blur.
        let covariance = covariance / 4.0 - Matrix2::from_diagonal_element(1.0 / 16.0);
        let first = self.column * TILE;
        for (right, above) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            kernel.set(&covariance, &Vector2::new(0.5 * right as f64 - 0.25, 0.5 * above as f64 - 0.25));
            for (row, cells) in (self.row * HALF..).zip(self.rows.chunks_mut(self.width).skip(above).step_by(2)) {
                let sums = field.convolved::<HALF>(kernel, self.column * HALF, row);
                cells[first..].iter_mut().skip(right).step_by(2).zip(sums).for_each(|(cell, sum)| *cell = sum);
            }
        }
    }
}

/// Known cells of a map, by tiles.
struct KnownTiles {
    /// Number of tiles with known cells below and left of each corner of a tile.
    sums: Vec<u32>,
    columns: usize,
    rows: usize,
}

impl KnownTiles {
    fn of(log_odds: &[f32], geometry: &GridGeometry) -> Self {
        let width = geometry.width;
        let (columns, rows) = (width.div_ceil(TILE), geometry.height.div_ceil(TILE));
        let mut sums = vec![0; (columns + 1) * (rows + 1)];
        for (tile_row, rows) in log_odds.chunks(width * TILE).enumerate() {
            let mut of_row = 0;
            for tile_column in 0..columns {
                let (first, last) = (tile_column * TILE, width.min((tile_column + 1) * TILE));
                let says = rows.chunks(width).any(|row| row[first..last].iter().any(|value| *value != 0.0));
                of_row += u32::from(says);
                sums[(tile_row + 1) * (columns + 1) + tile_column + 1] =
                    of_row + sums[tile_row * (columns + 1) + tile_column + 1];
            }
        }
        Self { sums, columns, rows }
    }

    /// Whether any cell is known within `reach` cells of a tile, rounded up to whole tiles.
    fn within(&self, tile_column: usize, tile_row: usize, reach: usize) -> bool {
        let tiles = reach.div_ceil(TILE);
        let stride = self.columns + 1;
        let (left, right) = (tile_column.saturating_sub(tiles), (tile_column + tiles + 1).min(self.columns));
        let (low, high) = (tile_row.saturating_sub(tiles), (tile_row + tiles + 1).min(self.rows));
        let sum = |row: usize, column: usize| self.sums[row * stride + column];
        sum(high, right) + sum(low, left) > sum(low, right) + sum(high, left)
    }
}

/// The covariance in the middle of a tile, in square cells along the axes of the grid.
fn covariance_of_tile(
    geometry: &GridGeometry,
    covariance: &PointCovariance,
    tile_column: usize,
    tile_row: usize,
) -> Matrix2<f64> {
    let middle = Vector2::new(tile_column as f64 + 0.5, tile_row as f64 + 0.5) * (TILE as f64 * geometry.resolution);
    in_cells(&covariance.at(&(geometry.origin * nalgebra::Point2::from(middle))), geometry)
}

fn in_cells(covariance: &Matrix2<f64>, geometry: &GridGeometry) -> Matrix2<f64> {
    let turn = geometry.origin.rotation.to_rotation_matrix().into_inner();
    turn.transpose() * covariance * turn / geometry.resolution.powi(2)
}

/// The same as the paper prints it: every cell with a kernel of its own that is as large as the map, and not cut. It
/// takes time by the square of the number of cells.
pub fn convolve_exactly(log_odds: &[f32], geometry: &GridGeometry, covariance: &PointCovariance) -> Vec<f32> {
    let (width, height) = (geometry.width as isize, geometry.height as isize);
    let of_cell = |index: usize| {
        let cell = Cell { column: index % geometry.width, row: index / geometry.width };
        let covariance = in_cells(&covariance.at(&geometry.centre(cell)), geometry);
        let Some(inverse) = covariance.try_inverse() else { return 0.0 };
        let (column, row) = (cell.column as isize, cell.row as isize);
        let weight = |column: isize, row: isize| {
            let off = Vector2::new(column as f64, row as f64);
            (-0.5 * (off.transpose() * inverse * off)[0]).exp()
        };
        let (mut sum, mut total) = (0.0, 0.0);
        // Beyond the map nothing is known, and counts as such.
        for off_row in -height..=height {
            for off_column in -width..=width {
                let weight = weight(off_column, off_row);
                total += weight;
                let (column, row) = (column + off_column, row + off_row);
                if (0..width).contains(&column) && (0..height).contains(&row) {
                    sum += weight * f64::from(log_odds[(row * width + column) as usize]);
                }
            }
        }
        (sum / total) as f32
    };
    (0..log_odds.len()).into_par_iter().map(of_cell).collect()
}

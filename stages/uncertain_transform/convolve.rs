//! A map convolved with a Gaussian that is another at every place.

use super::{Kernel, PointCovariance};
use crate::geometry::{Cell, GridGeometry};
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

/// Cells along the side of a tile, which has one kernel.
pub const TILE: usize = 8;

/// A map in log-odds, with empty cells round it so that kernels need not ask where it ends.
struct Padded {
    cells: Vec<f32>,
    width: usize,
    reach: usize,
    /// How many cells say something in the tiles below and left of each corner of a tile.
    sums: Vec<u32>,
    tile_columns: usize,
}

/// Convolves a map in log-odds, on cells of `geometry` in the world, with the kernel of each tile (algorithm 1, step 6).
///
/// `log_odds` and `blurred` have the cells of `geometry`, row by row. Where nothing is said within the reach of a kernel,
/// the result is 0.
pub fn convolve(log_odds: &[f32], geometry: &GridGeometry, covariance: &PointCovariance, blurred: &mut [f32]) {
    let (width, height) = (geometry.width, geometry.height);
    if width == 0 || height == 0 {
        return;
    }
    let corners = [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)];
    let corners = corners.map(|(column, row)| geometry.centre(Cell { column, row }));
    let padded =
        Padded::new(log_odds, width, Kernel::reach(covariance.greatest_deviation(&corners) / geometry.resolution));
    blurred.par_chunks_mut(width * TILE).enumerate().for_each_init(Kernel::default, |kernel, (tile_row, rows)| {
        for tile_column in 0..width.div_ceil(TILE) {
            let covariance = covariance_of_tile(geometry, covariance, tile_column, tile_row);
            let deviation = covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
            if !padded.says_something(tile_column, tile_row, Kernel::reach(deviation)) {
                continue;
            }
            kernel.set(&covariance);
            let first = tile_column * TILE;
            for (offset, row) in rows.chunks_mut(width).enumerate() {
                let sums = padded.sums(kernel, first, tile_row * TILE + offset);
                let last = width.min(first + TILE);
                row[first..last].copy_from_slice(&sums[..last - first]);
            }
        }
    });
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

impl Padded {
    fn new(log_odds: &[f32], width: usize, reach: usize) -> Self {
        let height = log_odds.len() / width;
        let (tile_columns, tile_rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        // The last tile may be wider than the map.
        let padded_width = tile_columns * TILE + 2 * reach;
        let mut cells = vec![0.0; padded_width * (height + 2 * reach)];
        for (row, values) in log_odds.chunks_exact(width).enumerate() {
            let start = (row + reach) * padded_width + reach;
            cells[start..start + width].copy_from_slice(values);
        }
        let mut sums = vec![0; (tile_columns + 1) * (tile_rows + 1)];
        for (tile_row, rows) in log_odds.chunks(width * TILE).enumerate() {
            let mut of_row = 0;
            for tile_column in 0..tile_columns {
                let (first, last) = (tile_column * TILE, width.min((tile_column + 1) * TILE));
                let says = rows.chunks(width).any(|row| row[first..last].iter().any(|value| *value != 0.0));
                of_row += u32::from(says);
                sums[(tile_row + 1) * (tile_columns + 1) + tile_column + 1] =
                    of_row + sums[tile_row * (tile_columns + 1) + tile_column + 1];
            }
        }
        Self { cells, width: padded_width, reach, sums, tile_columns }
    }

    /// Whether any cell says something within `reach` cells of a tile, as far as whole tiles tell.
    fn says_something(&self, tile_column: usize, tile_row: usize, reach: usize) -> bool {
        let tiles = reach.div_ceil(TILE);
        let stride = self.tile_columns + 1;
        let tile_rows = self.sums.len() / stride - 1;
        let (left, right) = (tile_column.saturating_sub(tiles), (tile_column + tiles + 1).min(self.tile_columns));
        let (low, high) = (tile_row.saturating_sub(tiles), (tile_row + tiles + 1).min(tile_rows));
        let sum = |row: usize, column: usize| self.sums[row * stride + column];
        sum(high, right) + sum(low, left) > sum(low, right) + sum(high, left)
    }

    /// The convolution at [`TILE`] cells of a row, from column `first` on.
    fn sums(&self, kernel: &Kernel, first: usize, row: usize) -> [f32; TILE] {
        let mut sums = [0.0; TILE];
        for (above, right, weights) in kernel.rows() {
            let start = (row + self.reach).wrapping_add_signed(above) * self.width;
            let start = (start + first + self.reach).wrapping_add_signed(right);
            let Some(cells) = self.cells.get(start..start + weights.len() + TILE - 1) else { continue };
            for (weight, cells) in weights.iter().zip(cells.windows(TILE)) {
                for (sum, cell) in sums.iter_mut().zip(cells) {
                    *sum += weight * cell;
                }
            }
        }
        sums
    }
}

/// The same as the paper prints it: every cell with a kernel of its own that is as large as the map, and not cut. It takes
/// time by the square of the number of cells.
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

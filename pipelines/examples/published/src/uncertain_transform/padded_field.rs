//! A field of log-odds with empty cells round it.

use super::Kernel;
use gridweave_stages::shared::geometry::GridGeometry;

/// Log-odds by cell, with empty cells round them so that kernels need not ask where the map ends.
pub(super) struct PaddedField {
    cells: Vec<f32>,
    width: usize,
    /// Empty cells before the first and behind the last, along both axes.
    margin: usize,
}

impl PaddedField {
    /// The cells of a map, row by row, with as many empty ones round them as a kernel of that standard deviation
    /// reaches, in cells.
    pub(super) fn new(log_odds: &[f32], geometry: &GridGeometry, deviation: f64) -> Self {
        let mut field = Self::empty(geometry.width, geometry.height, deviation);
        for (row, values) in log_odds.chunks_exact(geometry.width).enumerate() {
            let start = (row + field.margin) * field.width + field.margin;
            field.cells[start..start + values.len()].copy_from_slice(values);
        }
        field
    }

    /// The same on cells twice as wide: each the mean of four. `deviation` is in cells of the map.
    pub(super) fn coarse(log_odds: &[f32], geometry: &GridGeometry, deviation: f64) -> Self {
        let mut field = Self::empty(geometry.width.div_ceil(2), geometry.height.div_ceil(2), 0.5 * deviation);
        for (row, values) in log_odds.chunks_exact(geometry.width).enumerate() {
            let start = (row / 2 + field.margin) * field.width + field.margin;
            for (cell, pair) in field.cells[start..].iter_mut().zip(values.chunks(2)) {
                *cell += 0.25 * pair.iter().sum::<f32>();
            }
        }
        field
    }

    fn empty(width: usize, height: usize, deviation: f64) -> Self {
        // A kernel may stand beside the middle of its cell, and the last tile of a row may be wider than the map.
        let margin = Kernel::reach(deviation) + 1;
        let width = width + super::TILE + 2 * margin;
        Self { cells: vec![0.0; width * (height + 2 * margin)], width, margin }
    }

    /// The convolution at `N` cells of a row, from column `first` on.
    pub(super) fn convolved<const N: usize>(&self, kernel: &Kernel, first: usize, row: usize) -> [f32; N] {
        let mut sums = [0.0; N];
        for (above, right, weights) in kernel.rows() {
            let start = (row + self.margin).wrapping_add_signed(above) * self.width;
            let start = (start + first + self.margin).wrapping_add_signed(right);
            let Some(cells) = self.cells.get(start..start + weights.len() + N - 1) else { continue };
            for (weight, cells) in weights.iter().zip(cells.windows(N)) {
                for (sum, cell) in sums.iter_mut().zip(cells) {
                    *sum += weight * cell;
                }
            }
        }
        sums
    }
}

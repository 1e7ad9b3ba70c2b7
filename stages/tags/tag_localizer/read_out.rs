//! Position and certainty of a tag from its posterior (equation 2).

use super::{Posterior, Readout};
use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};

/// A mode ends where the log-likelihood is this much below its peak: four standard deviations away.
const END_OF_MODE: f64 = 8.0;

/// The most probable position of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagMode {
    /// Mean of the mode, metres, map frame.
    pub position: Point2,
    /// Covariance of the mode, square metres. Other modes, such as the mirror image, do not widen it.
    pub covariance: Matrix2<f64>,
    /// Share of the whole probability in the window or block, 0 to 1.
    pub certainty: f64,
    /// Centre of that window or block, metres, map frame.
    pub window: Point2,
    /// Share of the whole probability in the mode, 0 to 1.
    pub mass: f64,
}

/// Finds the window or block of `window` x `window` cells with the largest share of the probability, and its mode:
/// all cells that are connected with its best one by cells within 8 nats of that one. `None` if the posterior is
/// empty.
pub fn read_out(posterior: &Posterior, readout: Readout, window: usize) -> Option<TagMode> {
    let masses = CellMasses::new(posterior)?;
    let window = window.clamp(1, posterior.grid.cells);
    let found = match readout {
        Readout::Window => masses.best_window(window),
        Readout::Blocks => masses.best_block(window),
    };
    let in_mode = masses.mode_of(found.columns, found.rows);
    let members =
        || posterior.leaves.iter().filter(|leaf| in_mode.get(masses.index(leaf.column, leaf.row)) == Some(&true));
    let mass: f64 = members().map(|leaf| leaf.mass).sum();
    if !(mass > 0.0 && mass.is_finite()) {
        return None;
    }
    // Sums are relative to one member, so that no digits are lost far from the origin.
    let anchor = members().next()?.place;
    let mean = members().fold(Vector2::zeros(), |sum, leaf| sum + (leaf.place - anchor) * (leaf.mass / mass));
    let position = anchor + mean;
    let mut covariance = members().fold(Matrix2::zeros(), |sum, leaf| {
        let offset = leaf.place - position;
        sum + offset * offset.transpose() * (leaf.mass / mass)
    });
    // The distribution within a leaf is uniform.
    let within = posterior.leaf_size * posterior.leaf_size / 12.0;
    for axis in 0..2 {
        covariance[(axis, axis)] = covariance[(axis, axis)].max(within);
    }
    let window = posterior.grid.middle(found.columns, found.rows);
    Some(TagMode { position, covariance, certainty: found.mass.min(1.0), window, mass: mass.min(1.0) })
}

/// Mass of each cell in the bounding box of all leaves.
struct CellMasses {
    cells: usize,
    first_column: usize,
    first_row: usize,
    width: usize,
    height: usize,
    masses: Vec<f64>,
}

/// The cells of a window or block, and their mass. The ends are excluded.
struct Found {
    columns: (usize, usize),
    rows: (usize, usize),
    mass: f64,
}

impl CellMasses {
    fn new(posterior: &Posterior) -> Option<Self> {
        let first_column = posterior.leaves.iter().map(|leaf| leaf.column).min()?;
        let first_row = posterior.leaves.iter().map(|leaf| leaf.row).min()?;
        let last_column = posterior.leaves.iter().map(|leaf| leaf.column).max()?;
        let last_row = posterior.leaves.iter().map(|leaf| leaf.row).max()?;
        let (width, height) = (last_column - first_column + 1, last_row - first_row + 1);
        let masses = vec![0.0; width * height];
        let mut cells = Self { cells: posterior.grid.cells, first_column, first_row, width, height, masses };
        for leaf in &posterior.leaves {
            let index = cells.index(leaf.column, leaf.row);
            cells.masses[index] += leaf.mass;
        }
        Some(cells)
    }

    /// Index in `masses` of a cell of the grid, which must be in the box.
    fn index(&self, column: usize, row: usize) -> usize {
        (row - self.first_row) * self.width + (column - self.first_column)
    }

    /// Sums of the cells from the first to before the given one in both directions.
    fn integral(&self) -> Vec<f64> {
        let stride = self.width + 1;
        let mut sums = vec![0.0; stride * (self.height + 1)];
        for row in 0..self.height {
            let mut along = 0.0;
            for column in 0..self.width {
                along += self.masses[row * self.width + column];
                sums[(row + 1) * stride + column + 1] = sums[row * stride + column + 1] + along;
            }
        }
        sums
    }

    /// The best of the given windows, which begin at these columns and rows. The first of equals.
    fn best(
        &self,
        size: usize,
        columns: impl Iterator<Item = usize> + Clone,
        rows: impl Iterator<Item = usize>,
    ) -> Found {
        let sums = self.integral();
        let clip = |value: usize, first: usize, count: usize| value.saturating_sub(first).min(count);
        let mut best = Found { columns: (0, 0), rows: (0, 0), mass: f64::NEG_INFINITY };
        for row in rows {
            let low = clip(row, self.first_row, self.height) * (self.width + 1);
            let high = clip(row + size, self.first_row, self.height) * (self.width + 1);
            for column in columns.clone() {
                let left = clip(column, self.first_column, self.width);
                let right = clip(column + size, self.first_column, self.width);
                let mass = sums[high + right] - sums[high + left] - sums[low + right] + sums[low + left];
                if mass > best.mass {
                    best = Found { columns: (column, column + size), rows: (row, row + size), mass };
                }
            }
        }
        best
    }

    /// The best sliding window on the grid.
    fn best_window(&self, size: usize) -> Found {
        let starts = |first: usize, count: usize| {
            let last = (first + count - 1).min(self.cells - size);
            (first + 1).saturating_sub(size).min(last)..=last
        };
        self.best(size, starts(self.first_column, self.width), starts(self.first_row, self.height))
    }

    /// The best block of the raster that begins at the grid's corner.
    fn best_block(&self, size: usize) -> Found {
        let starts = |first: usize, count: usize| (first / size * size..first + count).step_by(size);
        self.best(size, starts(self.first_column, self.width), starts(self.first_row, self.height))
    }

    /// Which cells are connected with the best one among the given columns and rows.
    fn mode_of(&self, columns: (usize, usize), rows: (usize, usize)) -> Vec<bool> {
        let mut in_mode = vec![false; self.masses.len()];
        let range = |(start, end): (usize, usize), first: usize, count: usize| {
            start.saturating_sub(first).min(count)..end.saturating_sub(first).min(count)
        };
        let mut peak = (0.0, None);
        for row in range(rows, self.first_row, self.height) {
            for column in range(columns, self.first_column, self.width) {
                let mass = self.masses[row * self.width + column];
                if mass > peak.0 {
                    peak = (mass, Some((column, row)));
                }
            }
        }
        let least = peak.0 * (-END_OF_MODE).exp();
        let mut open: Vec<(usize, usize)> = peak.1.into_iter().collect();
        while let Some((column, row)) = open.pop() {
            let index = row * self.width + column;
            if in_mode[index] || self.masses[index] <= least {
                continue;
            }
            in_mode[index] = true;
            for row in row.saturating_sub(1)..=(row + 1).min(self.height - 1) {
                for column in column.saturating_sub(1)..=(column + 1).min(self.width - 1) {
                    open.push((column, row));
                }
            }
        }
        in_mode
    }
}

#[cfg(test)]
mod tests {
    use super::super::{GridSize, Leaf, Likelihood, Ring};
    use super::*;

    const GRID: GridSize = GridSize { centre: Point2::new(0.0, 0.0), cells: 300, resolution: 0.02 };

    fn posterior(tag: Point2, positions: impl Iterator<Item = (f64, f64)>) -> Posterior {
        let rings = positions.map(|(x, y)| {
            let centre = Point2::new(x, y);
            Ring { centre, radius: (tag - centre).norm(), variance: 0.05 * 0.05 }
        });
        Posterior::new(&Likelihood::of_rings(rings, 0.0, 3.0), GRID).unwrap()
    }

    fn round_drive() -> impl Iterator<Item = (f64, f64)> {
        (0..100).map(|step| 0.0628 * f64::from(step)).map(|angle| (angle.cos(), angle.sin()))
    }

    #[test]
    fn the_covariance_is_that_of_the_readings() {
        // Half of the 100 readings count along each axis: 0.05 m / sqrt(50).
        let mode = read_out(&posterior(Point2::new(0.0, 0.0), round_drive()), Readout::Window, 3).unwrap();
        for axis in 0..2 {
            let stddev = mode.covariance[(axis, axis)].sqrt();
            assert!((stddev - 0.05 / 50f64.sqrt()).abs() < 0.0005, "{stddev}");
        }
    }

    fn leaf(column: usize, row: usize, mass: f64) -> Leaf {
        Leaf { place: Point2::new(0.02 * column as f64, 0.02 * row as f64), column, row, mass }
    }

    #[test]
    fn the_window_stays_on_the_grid() {
        let corners = vec![leaf(0, 0, 0.2), leaf(299, 299, 0.5), leaf(0, 299, 0.3)];
        let posterior = Posterior { grid: GRID, leaf_size: 0.02, leaves: corners };
        for (window, certainty) in [(1, 0.5), (2, 0.5), (3, 0.5), (299, 0.5), (300, 1.0), (1000, 1.0)] {
            let mode = read_out(&posterior, Readout::Window, window).unwrap();
            assert!((mode.certainty - certainty).abs() < 1e-12, "{window} {mode:?}");
            assert_eq!(mode.position, Point2::new(5.98, 5.98));
            let mode = read_out(&posterior, Readout::Blocks, window).unwrap();
            assert_eq!(mode.position, Point2::new(5.98, 5.98), "{window}");
        }
    }

    #[test]
    fn an_empty_posterior_has_no_mode() {
        let posterior = Posterior { grid: GRID, leaf_size: 0.02, leaves: vec![] };
        assert_eq!(read_out(&posterior, Readout::Window, 3), None);
    }
}

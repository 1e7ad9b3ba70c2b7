//! The line of a wall cell, fitted to the wall cells around it.

use crate::shared::geometry::{Cell, Point2};
use nalgebra::Vector2;

/// A point on the line through a cell's neighbours, and that line's normal, in cells.
pub(super) struct LineFit {
    pub(super) point: Point2,
    pub(super) normal: Vector2<f64>,
}

/// Cells by row. Few cells of a window are walls, so it is faster to visit those only.
pub(super) struct CellRows {
    /// Start of each row in `columns`, and the end of the last.
    starts: Vec<usize>,
    /// Columns, rising within a row. Sides of grids are less than 2^32.
    columns: Vec<u32>,
}

impl CellRows {
    /// Cells sorted by row and column, in a grid of `height` rows.
    pub(super) fn new(cells: impl Iterator<Item = Cell>, height: usize) -> Self {
        let (mut starts, mut columns) = (Vec::with_capacity(height + 1), Vec::new());
        for cell in cells {
            while starts.len() <= cell.row {
                starts.push(columns.len());
            }
            columns.push(cell.column as u32);
        }
        starts.resize(height + 1, columns.len());
        Self { starts, columns }
    }

    /// The number of cells.
    pub(super) fn len(&self) -> usize {
        self.columns.len()
    }

    /// The cells, row by row.
    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> {
        let rows = self.starts.windows(2).enumerate();
        rows.flat_map(|(row, ends)| {
            self.columns[ends[0]..ends[1]].iter().map(move |column| Cell { column: *column as usize, row })
        })
    }

    /// The columns of a row's cells from `first` to `last`; none for a row outside the grid.
    fn between(&self, row: usize, first: usize, last: usize) -> impl Iterator<Item = usize> {
        let columns = match (self.starts.get(row), self.starts.get(row.saturating_add(1))) {
            (Some(&start), Some(&end)) => &self.columns[start..end],
            _ => &[],
        };
        let start = columns.partition_point(|column| (*column as usize) < first);
        columns[start..].iter().map(|column| *column as usize).take_while(move |column| *column <= last)
    }
}

/// The cells within a radius.
pub(super) struct Window {
    /// For each row from the middle: the number of columns to either side.
    reaches: Vec<(isize, usize)>,
}

impl Window {
    /// A window of `radius` cells, at least two and at most 32.
    pub(super) fn new(radius: f64) -> Self {
        let radius = radius.clamp(2.0, 32.0);
        let most = radius as isize;
        let reach = |row: isize| (radius * radius - (row * row) as f64).sqrt() as usize;
        Self { reaches: (-most..=most).map(|row| (row, reach(row))).collect() }
    }

    /// The cells in the window round `cell`, row by row.
    fn cells(&self, rows: &CellRows, cell: Cell) -> impl Iterator<Item = Cell> {
        self.reaches.iter().flat_map(move |&(row, reach)| {
            let row = cell.row.checked_add_signed(row).unwrap_or(usize::MAX);
            let columns = rows.between(row, cell.column.saturating_sub(reach), cell.column + reach);
            columns.map(move |column| Cell { column, row })
        })
    }

    /// The line through the wall cells in the window round `cell`: the main axis of their scatter.
    pub(super) fn fit(&self, walls: &CellRows, cell: Cell) -> LineFit {
        let (mut count, mut sum, mut squares, mut product) = (0.0, Vector2::zeros(), Vector2::zeros(), 0.0);
        for other in self.cells(walls, cell) {
            let offset = Vector2::new(other.column as f64 - cell.column as f64, other.row as f64 - cell.row as f64);
            count += 1.0;
            sum += offset;
            squares += offset.component_mul(&offset);
            product += offset.x * offset.y;
        }
        let centre = Point2::new(cell.column as f64 + 0.5, cell.row as f64 + 0.5);
        // Two cells make a line, but not a reliable one.
        if count < 3.0 {
            return LineFit { point: centre, normal: Vector2::zeros() };
        }
        let mean = sum / count;
        let variance = squares / count - mean.component_mul(&mean);
        let covariance = product / count - mean.x * mean.y;
        let half_difference = (variance.x - variance.y) / 2.0;
        let spread = half_difference.hypot(covariance);
        let across = (variance.x + variance.y) / 2.0 - spread;
        let along = across + 2.0 * spread;
        // A blob has no direction.
        if across > 0.35 * along {
            return LineFit { point: centre, normal: Vector2::zeros() };
        }
        let direction = covariance.atan2(half_difference) / 2.0;
        let normal = Vector2::new(-direction.sin(), direction.cos());
        LineFit { point: centre + normal * normal.dot(&mean), normal }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_contains_the_cells_within_its_radius() {
        let cells: Vec<Cell> =
            (0..900).filter(|i| i * 7 % 11 < 4).map(|i| Cell { column: i % 30, row: i / 30 }).collect();
        let rows = CellRows::new(cells.iter().copied(), 30);
        assert_eq!((rows.len(), rows.cells().collect::<Vec<_>>()), (cells.len(), cells.clone()));
        for (radius, cell) in
            [(2.0, Cell { column: 0, row: 0 }), (4.7, cells[100]), (9.0, Cell { column: 29, row: 28 })]
        {
            let squared =
                |other: &Cell| other.column.abs_diff(cell.column).pow(2) + other.row.abs_diff(cell.row).pow(2);
            let expected: Vec<Cell> =
                cells.iter().copied().filter(|other| squared(other) as f64 <= radius * radius).collect();
            let found: Vec<Cell> = Window::new(radius).cells(&rows, cell).collect();
            assert_eq!(found, expected);
        }
    }
}

//! The known cells of a grid.

use crate::shared::geometry::{Grid, Point2, is_known};

/// Cells along the side of a tile.
pub const TILE: usize = 32;

/// The cells of a grid between the first and the last known one of every row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownArea {
    rows: Vec<KnownRow>,
    /// The columns that contain all known cells: the first, and the one after the last.
    pub columns: (usize, usize),
    /// For every tile, row by row, whether it or one of its eight neighbours contains a known cell.
    near: Vec<bool>,
    tile_columns: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct KnownRow {
    row: usize,
    first: usize,
    behind: usize,
}

impl KnownArea {
    /// Finds the known cells of a grid. No rows if there are none.
    pub fn of(grid: &Grid<'_>) -> Self {
        let (tile_columns, tile_rows) = (grid.geometry.width.div_ceil(TILE), grid.geometry.height.div_ceil(TILE));
        let near = vec![false; tile_columns * tile_rows];
        let mut area = Self { rows: Vec::new(), columns: (0, 0), near, tile_columns };
        let is_known = |value: &i8| is_known(*value);
        for (row, cells) in grid.cells.chunks_exact(grid.geometry.width.max(1)).enumerate() {
            let Some(first) = cells.iter().position(is_known) else { continue };
            let behind = cells.iter().rposition(is_known).map_or(cells.len(), |last| last + 1);
            area.columns = match area.rows.is_empty() {
                true => (first, behind),
                false => (area.columns.0.min(first), area.columns.1.max(behind)),
            };
            area.rows.push(KnownRow { row, first, behind });
            for (tile, cells) in cells.chunks(TILE).enumerate() {
                if !area.near[row / TILE * tile_columns + tile] && cells.iter().any(is_known) {
                    area.near[row / TILE * tile_columns + tile] = true;
                }
            }
        }
        area.spread_tiles();
        area
    }

    /// Marks the neighbours of the tiles that are marked.
    fn spread_tiles(&mut self) {
        let columns = self.tile_columns;
        let known = self.near.clone();
        for (index, _) in known.iter().enumerate().filter(|(_, is_known)| **is_known) {
            let (column, row) = (index % columns, index / columns);
            for row in row.saturating_sub(1)..=row + 1 {
                for column in column.saturating_sub(1)..=(column + 1).min(columns - 1) {
                    if let Some(near) = self.near.get_mut(row * columns + column) {
                        *near = true;
                    }
                }
            }
        }
    }

    /// Whether there may be known cells within [`TILE`] cells of a position, in cells along x and y. A position
    /// outside the grid counts as the nearest one on it.
    pub fn is_near(&self, x: f64, y: f64) -> bool {
        let column = (x.max(0.0) as usize / TILE).min(self.tile_columns.saturating_sub(1));
        let row = y.max(0.0) as usize / TILE;
        let last_row = (self.near.len() / self.tile_columns.max(1)).saturating_sub(1);
        self.near.get(row.min(last_row) * self.tile_columns + column).is_some_and(|near| *near)
    }

    /// Whether no cell is known.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows that contain all known cells: the first, and the one after the last.
    pub fn row_range(&self) -> (usize, usize) {
        match (self.rows.first(), self.rows.last()) {
            (Some(first), Some(last)) => (first.row, last.row + 1),
            _ => (0, 0),
        }
    }

    /// Number of cells between the first and the last known one of every row.
    pub(super) fn cell_count(&self) -> usize {
        self.rows.iter().map(|row| row.behind - row.first).sum()
    }

    /// The corners of the known parts of all rows, in cells.
    pub(super) fn corners(&self) -> impl Iterator<Item = Point2> + '_ {
        self.rows.iter().flat_map(|&KnownRow { row, first, behind }| {
            [(first, row), (behind, row), (first, row + 1), (behind, row + 1)]
                .map(|(x, y)| Point2::new(x as f64, y as f64))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, Pose2};

    fn grid(width: usize, cells: &[i8]) -> Grid<'_> {
        let height = cells.len() / width;
        Grid::new(GridGeometry { width, height, resolution: 0.05, origin: Pose2::identity() }, cells).unwrap()
    }

    #[test]
    fn the_known_area_is_found() {
        #[rustfmt::skip]
        let cells = [
            -1, -1, -1, -1, -1, -1,
            -1, -1,  0, 50, -1, -1,
            -1,  0, -1, -1, -1, -1,
            -1, -1, -1, -1, -1, -1,
        ];
        let area = KnownArea::of(&grid(6, &cells));
        assert_eq!((area.columns, area.row_range()), ((1, 4), (1, 3)));
        for nothing in [&[-1; 24][..], &[]] {
            let area = KnownArea::of(&grid(6, nothing));
            assert!(area.is_empty() && !area.is_near(0.0, 0.0));
        }
    }

    #[test]
    fn no_known_cell_is_farther_from_a_near_position_than_a_tile() {
        let mut cells = vec![-1; 200 * 150];
        cells[70 * 200 + 100] = 0;
        let area = KnownArea::of(&grid(200, &cells));
        for (x, y) in [(100.0, 70.0), (69.0, 70.0), (131.9, 101.9), (69.0, 39.0)] {
            assert!(area.is_near(x, y), "({x}, {y})");
        }
        for (x, y) in [(0.0, 0.0), (199.0, 149.0), (100.0, 149.0), (-5.0, 1e9), (f64::NAN, 0.0)] {
            assert!(!area.is_near(x, y), "({x}, {y})");
        }
    }
}

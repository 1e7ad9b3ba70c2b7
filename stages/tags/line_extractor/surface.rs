//! Reduces solids to their surface.
//!
//! Through the inside of a solid, such as a filled pillar or a map that is occupied all over, there are lines of
//! every direction, and none of them is a wall.

use crate::shared::geometry::{Cell, Grid, is_occupied};

/// Largest depth of a surface in cells, whatever the cell size.
const MOST_DEPTH: f64 = 10.0;

/// The occupied cells, row by row, without those deeper inside a solid than `reach` cells. Cells off the grid count
/// as solid: the edge of a map is no wall.
pub(super) fn surface_cells(grid: &Grid<'_>, reach: f64) -> Vec<Cell> {
    let depth = reach.ceil().clamp(1.0, MOST_DEPTH) as usize;
    grid.occupied().filter(|cell| !is_inside(grid, *cell, depth)).collect()
}

/// Whether all cells up to `depth` columns and rows away are occupied.
fn is_inside(grid: &Grid<'_>, cell: Cell, depth: usize) -> bool {
    let solid = |column: usize, row: usize| {
        let off_grid = column >= grid.geometry.width || row >= grid.geometry.height;
        off_grid || is_occupied(grid.value(Cell { column, row }))
    };
    let Cell { column, row } = cell;
    let (left, right) = (column.saturating_sub(depth), column + depth);
    let (low, high) = (row.saturating_sub(depth), row + depth);
    // Most walls are thin, and free on one of the four sides.
    let sides = solid(left, row) && solid(right, row) && solid(column, low) && solid(column, high);
    sides && (low..=high).all(|row| (left..=right).all(|column| solid(column, row)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, Pose2};

    fn kept(width: usize, height: usize, occupied: impl Fn(usize, usize) -> bool) -> Vec<Cell> {
        let geometry = GridGeometry { width, height, resolution: 0.05, origin: Pose2::identity() };
        let cells: Vec<i8> =
            (0..width * height).map(|i| if occupied(i % width, i / width) { 100 } else { 0 }).collect();
        surface_cells(&Grid::new(geometry, &cells).unwrap(), 1.6)
    }

    #[test]
    fn walls_of_up_to_four_cells_are_kept_whole() {
        for thickness in 1..=4 {
            let wall = |_: usize, row: usize| (5..5 + thickness).contains(&row);
            assert_eq!(kept(30, 15, wall).len(), 30 * thickness);
        }
    }

    #[test]
    fn a_map_that_is_occupied_all_over_has_no_surface() {
        assert_eq!(kept(40, 30, |_, _| true), []);
        assert_eq!(kept(0, 0, |_, _| true), []);
        assert_eq!(kept(40, 30, |column, _| column >= 5).len(), 2 * 30, "free space has one");
    }

    #[test]
    fn a_cell_of_any_size_ends_the_search() {
        let geometry = GridGeometry { width: 200, height: 200, resolution: 1e-9, origin: Pose2::identity() };
        assert_eq!(surface_cells(&Grid::new(geometry, &[100; 40_000]).unwrap(), 1e6), []);
    }
}

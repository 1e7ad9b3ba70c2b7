//! Bounding box of cells of a grid.

use super::Grid;
use std::ops::Range;

/// Bounding box of all cells of one sort.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellBox {
    /// Along the grid's y axis.
    pub rows: Range<usize>,
    /// Along the grid's x axis.
    pub columns: Range<usize>,
}

impl CellBox {
    /// The bounding box of all cells for which `is_of_sort` is true, enlarged by one cell to each side where the grid
    /// allows. None if there are none.
    pub fn holding(grid: &Grid<'_>, is_of_sort: impl Fn(i8) -> bool) -> Option<Self> {
        let (width, height) = (grid.geometry.width, grid.geometry.height);
        let mut held: Option<Self> = None;
        for (row, cells) in grid.cells.chunks_exact(width.max(1)).enumerate() {
            let is_of_sort = |value: &i8| is_of_sort(*value);
            let Some(first) = cells.iter().position(is_of_sort) else { continue };
            let last = cells.iter().rposition(is_of_sort).unwrap_or(first);
            let columns = held.as_ref().map_or(first..last, |held| held.columns.clone());
            let rows = held.map_or(row, |held| held.rows.start)..row;
            held = Some(Self { rows, columns: columns.start.min(first)..columns.end.max(last) });
        }
        let with_rim = |range: Range<usize>, count: usize| range.start.saturating_sub(1)..(range.end + 2).min(count);
        held.map(|held| Self { rows: with_rim(held.rows, height), columns: with_rim(held.columns, width) })
    }
}

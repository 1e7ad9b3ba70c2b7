//! The part of a grid that a skeleton is made in.

use crate::shared::geometry::{Cell, CellBox, GridGeometry};

/// The part of a grid that holds its free cells, with a rim of one cell all round that is never free: every cell that
/// matters has eight neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// Geometry of the grid.
    pub geometry: GridGeometry,
    pub(super) cell_box: CellBox,
    /// Cells of a row, the rim among them.
    pub(super) stride: usize,
}

impl Window {
    pub(super) fn new(geometry: GridGeometry, cell_box: CellBox) -> Self {
        let stride = cell_box.columns.len() + 2;
        Self { geometry, cell_box, stride }
    }

    /// How many cells there are, the rim among them.
    pub(super) fn cell_count(&self) -> usize {
        self.stride * (self.cell_box.rows.len() + 2)
    }

    /// The place of a cell of the grid in lists of the window's cells; none for what lies beyond its rim.
    pub(super) fn index(&self, cell: Cell) -> Option<usize> {
        let row = (cell.row + 1).checked_sub(self.cell_box.rows.start)?;
        let column = (cell.column + 1).checked_sub(self.cell_box.columns.start)?;
        (row < self.cell_box.rows.len() + 2 && column < self.stride).then_some(row * self.stride + column)
    }

    /// The cell of the grid at a place in lists of the window's cells, which is none of the rim.
    pub(super) fn cell(&self, index: usize) -> Cell {
        Cell {
            column: (index % self.stride + self.cell_box.columns.start).saturating_sub(1),
            row: (index / self.stride + self.cell_box.rows.start).saturating_sub(1),
        }
    }
}

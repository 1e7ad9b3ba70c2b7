//! Connected objects of the occupied cells of a map.

use super::MapCleanerParameters;
use crate::shared::geometry::{Cell, Grid};

/// Bounding box and size of connected occupied cells.
#[derive(Clone, Copy, Debug)]
struct Object {
    cells: usize,
    low: Cell,
    high: Cell,
}

impl Object {
    /// Whether it is a wall, in cells of `resolution` metres.
    fn is_wall(&self, resolution: f64, parameters: &MapCleanerParameters) -> bool {
        let width = (self.high.column - self.low.column + 1) as f64;
        let height = (self.high.row - self.low.row + 1) as f64;
        // A slanted line of cells has as many as it is long along its longer axis.
        let filled = self.cells as f64 >= parameters.min_fill * width.max(height);
        filled && width.hypot(height) * resolution >= parameters.min_wall_length
    }
}

/// The occupied cells that belong to no wall, row by row.
pub(super) fn loose_cells(grid: &Grid<'_>, parameters: &MapCleanerParameters) -> Vec<Cell> {
    let cells: Vec<Cell> = grid.occupied().collect();
    let reach = ((parameters.link / grid.geometry.resolution).round() as usize).max(2);
    let mut sets = DisjointSets::new(cells.len());
    let starts: Vec<usize> =
        (0..=grid.geometry.height).map(|row| cells.partition_point(|cell| cell.row < row)).collect();
    for (index, cell) in cells.iter().enumerate() {
        // Those above and to the left have been joined already.
        for row in cell.row..=(cell.row + reach).min(grid.geometry.height.saturating_sub(1)) {
            let of_row = &cells[starts[row]..starts[row + 1]];
            let first = of_row.partition_point(|other| other.column + reach < cell.column);
            let near = of_row[first..].iter().take_while(|other| other.column <= cell.column + reach);
            (starts[row] + first..).zip(near).for_each(|(other, _)| sets.join(index, other));
        }
    }
    let mut objects: Vec<Option<Object>> = vec![None; cells.len()];
    for (index, cell) in cells.iter().enumerate() {
        let object = objects[sets.root(index)].get_or_insert(Object { cells: 0, low: *cell, high: *cell });
        object.cells += 1;
        object.low = Cell { column: object.low.column.min(cell.column), row: object.low.row.min(cell.row) };
        object.high = Cell { column: object.high.column.max(cell.column), row: object.high.row.max(cell.row) };
    }
    let is_loose = |index: usize, sets: &mut DisjointSets| {
        objects[sets.root(index)].is_none_or(|object| !object.is_wall(grid.geometry.resolution, parameters))
    };
    (0..cells.len()).filter(|index| is_loose(*index, &mut sets)).map(|index| cells[index]).collect()
}

/// Disjoint sets of numbers that are joined to larger ones.
struct DisjointSets {
    parents: Vec<usize>,
}

impl DisjointSets {
    fn new(count: usize) -> Self {
        Self { parents: (0..count).collect() }
    }

    fn root(&mut self, mut member: usize) -> usize {
        while self.parents[member] != member {
            self.parents[member] = self.parents[self.parents[member]];
            member = self.parents[member];
        }
        member
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one.max(other)] = one.min(other);
    }
}

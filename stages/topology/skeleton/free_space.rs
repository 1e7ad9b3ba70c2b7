//! The free cells of a grid.

use super::Window;
use crate::shared::geometry::{CellBox, Grid, is_free};
use std::ops::Range;

/// The free cells of a grid, small holes filled.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeSpace {
    pub(super) window: Window,
    /// 1 for each cell of the window that is free, 0 for others.
    pub(super) cells: Vec<u8>,
}

impl FreeSpace {
    /// The free cells of a grid. Holes, occupied or unknown, become free as well if they cover at most `max_hole`
    /// square metres and do not reach the border of the grid. None if no cell is free.
    pub fn of(grid: &Grid<'_>, max_hole: f64) -> Option<Self> {
        let window = Window::new(grid.geometry, CellBox::holding(grid, is_free)?);
        let mut cells = vec![0; window.cell_count()];
        let CellBox { rows, columns } = &window.cell_box;
        for (into, row) in cells.chunks_exact_mut(window.stride).skip(1).zip(rows.clone()) {
            let from = &grid.cells[row * grid.geometry.width..][columns.clone()];
            for (cell, value) in into[1..].iter_mut().zip(from) {
                *cell = u8::from(is_free(*value));
            }
        }
        let area = grid.geometry.resolution * grid.geometry.resolution;
        fill_holes(&mut cells, window.stride, (max_hole / area).min(1e9) as usize);
        Some(Self { window, cells })
    }
}

/// A run of cells of one row that are not free.
struct Run {
    places: Range<usize>,
    /// A run of the same hole, or this one.
    parent: usize,
    /// Of the hole, if this is its own parent.
    hole_cells: usize,
}

/// Fills the holes of at most `most` cells. Cells of a hole are connected by their sides. The rim is connected with
/// what is around the window, and is no hole.
fn fill_holes(cells: &mut [u8], stride: usize, most: usize) {
    if most == 0 {
        return;
    }
    let mut runs: Vec<Run> = Vec::new();
    let mut above: Range<usize> = 0..0;
    for (row, of_row) in cells.chunks_exact(stride).enumerate() {
        let first = runs.len();
        append_runs(of_row, row * stride, &mut runs);
        let mut upper = above.start;
        for run in first..runs.len() {
            let places = runs[run].places.start.saturating_sub(stride)..runs[run].places.end.saturating_sub(stride);
            while upper < above.end && runs[upper].places.end <= places.start {
                upper += 1;
            }
            for other in upper..above.end {
                if runs[other].places.start >= places.end {
                    break;
                }
                join(&mut runs, other, run);
            }
        }
        above = first..runs.len();
    }
    for run in 0..runs.len() {
        let hole = root(&mut runs, run);
        if hole != 0 && runs[hole].hole_cells <= most {
            cells[runs[run].places.clone()].fill(1);
        }
    }
}

fn append_runs(of_row: &[u8], start: usize, runs: &mut Vec<Run>) {
    let mut column = 0;
    while let Some(first) = of_row[column..].iter().position(|cell| *cell == 0) {
        let first = column + first;
        let length = of_row[first..].iter().position(|cell| *cell != 0).unwrap_or(of_row.len() - first);
        runs.push(Run { places: start + first..start + first + length, parent: runs.len(), hole_cells: length });
        column = first + length;
    }
}

fn root(runs: &mut [Run], mut run: usize) -> usize {
    while runs[run].parent != run {
        runs[run].parent = runs[runs[run].parent].parent;
        run = runs[run].parent;
    }
    run
}

fn join(runs: &mut [Run], one: usize, other: usize) {
    let (one, other) = (root(runs, one), root(runs, other));
    if one != other {
        runs[one.max(other)].parent = one.min(other);
        runs[one.min(other)].hole_cells += runs[one.max(other)].hole_cells;
    }
}

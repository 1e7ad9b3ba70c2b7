//! The frame of a drawn sheet, with the title block in it.

use crate::shared::geometry::{CellBox, Grid, is_known, is_occupied};

/// Largest share of unknown cells of a drawing: a robot does not know what is behind walls, a drawing has paper there.
const MOST_UNKNOWN: f64 = 0.02;
/// Least share of the width and the height of the drawing that its frame has.
const LEAST_SPAN: f64 = 0.8;
/// How far the cells of a side lie from the outermost, cells, and the least share of the side that they fill.
const SIDE: usize = 4;
const LEAST_FILLED: f64 = 0.98;
/// Least share of the occupied cells that are not connected with the frame: where there are fewer, it is the outer wall
/// of the building.
const LEAST_REST: f64 = 0.1;

/// Largest difference of the sizes of two frames that are the same, as a share of it.
const SAME_SIZE: f64 = 0.02;

/// The rectangle along the edges of a drawing, and all that is connected with it, such as a title block.
#[derive(Clone, Debug, PartialEq)]
pub struct SheetFrame {
    /// Numbers of its cells.
    pub cells: Vec<usize>,
    /// Width and height, metres.
    pub size: [f64; 2],
}

impl SheetFrame {
    /// Whether it has the size of another one.
    pub fn is_as_large(&self, other: &[f64; 2]) -> bool {
        self.size.iter().zip(other).all(|(one, other)| (one - other).abs() <= SAME_SIZE * other)
    }
}

/// The frame of a drawn sheet. Sheets of one set have the same frame and the same title block, whatever they show. None
/// for a map of which much is unknown, as in those of robots, or where the rectangle is the wall of nearly all that is
/// drawn.
pub fn frame_of_sheet(grid: &Grid<'_>) -> Option<SheetFrame> {
    let (width, height) = (grid.geometry.width, grid.geometry.height);
    let most_unknown = (MOST_UNKNOWN * grid.cells.len() as f64) as usize;
    if grid.cells.iter().filter(|value| !is_known(**value)).nth(most_unknown).is_some() {
        return None;
    }
    let CellBox { rows, columns } = CellBox::holding(grid, is_occupied)?;
    let is_wide = |part: usize, whole: usize| part as f64 >= LEAST_SPAN * whole as f64;
    if !is_wide(rows.len(), height) || !is_wide(columns.len(), width) || rows.len().min(columns.len()) < 4 * SIDE {
        return None;
    }
    let is_wall = |column: usize, row: usize| is_occupied(grid.cells[row * width + column]);
    let has_side = |length: usize, meets: &dyn Fn(usize) -> bool| {
        (0..length).filter(|place| meets(*place)).count() as f64 >= LEAST_FILLED * length as f64
    };
    let (low, high) = (rows.start..rows.start + SIDE, rows.end - SIDE..rows.end);
    let (left, right) = (columns.start..columns.start + SIDE, columns.end - SIDE..columns.end);
    let is_frame = [low, high]
        .iter()
        .all(|side| has_side(columns.len(), &|place| side.clone().any(|row| is_wall(columns.start + place, row))))
        && [left, right]
            .iter()
            .all(|side| has_side(rows.len(), &|place| side.clone().any(|column| is_wall(column, rows.start + place))));
    if !is_frame {
        return None;
    }
    let middle = (columns.start + columns.end) / 2;
    let start = (rows.start..rows.start + SIDE).find(|row| is_wall(middle, *row))? * width + middle;
    let cells = connected(grid, start);
    let occupied = grid.cells.iter().filter(|value| is_occupied(**value)).count();
    let is_apart = (occupied - cells.len()) as f64 >= LEAST_REST * occupied as f64;
    let size = [columns.len(), rows.len()].map(|cells| cells as f64 * grid.geometry.resolution);
    is_apart.then_some(SheetFrame { cells, size })
}

/// The occupied cells that are connected with one, by sides or corners.
fn connected(grid: &Grid<'_>, start: usize) -> Vec<usize> {
    let (width, height) = (grid.geometry.width, grid.geometry.height);
    let mut is_found = vec![false; grid.cells.len()];
    is_found[start] = true;
    let mut found = vec![start];
    let mut looked_at = 0;
    while let Some(cell) = found.get(looked_at).copied() {
        looked_at += 1;
        let (column, row) = (cell % width, cell / width);
        for row in row.saturating_sub(1)..(row + 2).min(height) {
            for column in column.saturating_sub(1)..(column + 2).min(width) {
                let next = row * width + column;
                if is_occupied(grid.cells[next]) && !is_found[next] {
                    is_found[next] = true;
                    found.push(next);
                }
            }
        }
    }
    found
}

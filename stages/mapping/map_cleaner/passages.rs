//! Known space that is too narrow for a robot.

use crate::shared::geometry::{CellBox, Grid, is_known};
use std::ops::Range;

/// Whether each cell of the box, row by row, is known and in a square of `2 * radius + 1` known cells: the
/// morphological opening of the known space by that square (Serra 1982). Beyond the border of the grid all is known,
/// so that a map that is cut off there loses nothing.
pub(super) fn wide_known_space(grid: &Grid<'_>, known_box: &CellBox, radius: usize) -> Vec<bool> {
    let (width, height) = (known_box.columns.len(), known_box.rows.len());
    let mut known = Vec::with_capacity(width * height);
    for row in known_box.rows.clone() {
        let cells = &grid.cells[row * grid.geometry.width..][known_box.columns.clone()];
        known.extend(cells.iter().map(|value| is_known(*value)));
    }
    // Unknown cells beyond the box are no nearer to a known cell than the rim of the box.
    spread(&mut known, width, radius, false);
    spread(&mut known, width, radius, true);
    known
}

/// Dilates what is `value` by `radius` cells along rows, and then along columns.
fn spread(cells: &mut [bool], width: usize, radius: usize, value: bool) {
    if width == 0 {
        return;
    }
    let radius = radius.min(usize::from(u16::MAX - 1)) as u16;
    let mut line = Vec::with_capacity(width);
    for row in cells.chunks_exact_mut(width) {
        if row.contains(&value) {
            line.clear();
            line.extend_from_slice(row);
            spread_line(&line, usize::from(radius), value, |places| row[places].fill(value));
        }
    }
    // Row by row, in memory order: the number of rows since the last cell to dilate above, and then below, each
    // column.
    let source = cells.to_vec();
    let mut since = vec![u16::MAX; width];
    for (row, from) in cells.chunks_exact_mut(width).zip(source.chunks_exact(width)) {
        spread_row(row, from, &mut since, radius, value);
    }
    since.fill(u16::MAX);
    for (row, from) in cells.chunks_exact_mut(width).zip(source.chunks_exact(width)).rev() {
        spread_row(row, from, &mut since, radius, value);
    }
}

fn spread_line(line: &[bool], radius: usize, value: bool, mut fill: impl FnMut(Range<usize>)) {
    let mut until = 0;
    for (place, _) in line.iter().enumerate().filter(|(_, cell)| **cell == value) {
        let behind = (place + radius + 1).min(line.len());
        fill(until.max(place.saturating_sub(radius))..behind);
        until = behind;
    }
}

/// Processes a row, where `since` is for each column the number of rows since a cell to dilate.
fn spread_row(row: &mut [bool], from: &[bool], since: &mut [u16], radius: u16, value: bool) {
    for ((cell, from), since) in row.iter_mut().zip(from).zip(since) {
        *since = if *from == value { 0 } else { since.saturating_add(1) };
        *cell = if *since <= radius { value } else { *cell };
    }
}

//! Share of a map that has changed.

use crate::shared::geometry::{Grid, is_known, is_occupied};
use std::ops::Range;

/// Largest offset of a corner of two grids that share their cells, in cells.
const TOLERANCE: f64 = 0.01;

/// Number of cells that are unknown, occupied, or neither in one map and not in the other. Cells outside a grid are
/// unknown. None if the cells of the maps do not coincide.
pub fn changed_cells(before: &Grid<'_>, after: &Grid<'_>) -> Option<usize> {
    let (column, row) = offset(before, after)?;
    // The rows and columns of `before` that `after` has too.
    let rows = common(before.geometry.height, after.geometry.height, row);
    let columns = common(before.geometry.width, after.geometry.width, column);
    let mut changed = 0;
    if !rows.is_empty() && !columns.is_empty() {
        let first = columns.start.wrapping_add_signed(-column);
        for number in rows.clone() {
            let one = &before.cells[number * before.geometry.width..][columns.clone()];
            let other = number.wrapping_add_signed(-row) * after.geometry.width + first;
            let other = &after.cells[other..other + columns.len()];
            // Most rows are unchanged.
            if one != other {
                changed += one.iter().zip(other).filter(|(one, other)| kind_of(**one) != kind_of(**other)).count();
            }
        }
    }
    let rows_after = moved(&rows, -row);
    let columns_after = moved(&columns, -column);
    Some(changed + known_outside(before, &rows, &columns) + known_outside(after, &rows_after, &columns_after))
}

/// Number of known cells outside of some rows and columns.
fn known_outside(grid: &Grid<'_>, rows: &Range<usize>, columns: &Range<usize>) -> usize {
    let of_row = |(row, cells): (usize, &[i8])| match rows.contains(&row) {
        true => known_cells(&cells[..columns.start]) + known_cells(&cells[columns.end..]),
        false => known_cells(cells),
    };
    grid.cells.chunks_exact(grid.geometry.width.max(1)).enumerate().map(of_row).sum()
}

/// The cell of `before` that coincides with cell (0, 0) of `after`, if the cells coincide.
fn offset(before: &Grid<'_>, after: &Grid<'_>) -> Option<(isize, isize)> {
    let resolution = before.geometry.resolution;
    let to_before = before.geometry.origin.inverse() * after.geometry.origin;
    let place = to_before.translation.vector / resolution;
    // Offset of the cell that is farthest from the corner.
    let longest = after.geometry.width.max(after.geometry.height) as f64;
    let scale = after.geometry.resolution / resolution;
    let off =
        (place - place.map(f64::round)).amax() + longest * ((scale - 1.0).abs() + to_before.rotation.angle().abs());
    let is_near = place.amax() < 1e9 && off <= TOLERANCE;
    is_near.then(|| (place.x.round() as isize, place.y.round() as isize))
}

/// The part of `0..count` in common with a range of `other` numbers that begins at `offset`.
fn common(count: usize, other: usize, offset: isize) -> Range<usize> {
    let start = offset.max(0) as usize;
    let end = other.checked_add_signed(offset).unwrap_or(0).min(count);
    start.min(end)..end
}

/// A range moved by `by`; none if it is empty.
fn moved(range: &Range<usize>, by: isize) -> Range<usize> {
    match range.is_empty() {
        true => 0..0,
        false => range.start.wrapping_add_signed(by)..range.end.wrapping_add_signed(by),
    }
}

fn kind_of(value: i8) -> u8 {
    u8::from(is_known(value)) + u8::from(is_occupied(value))
}

/// Number of known cells.
pub fn known_cells(cells: &[i8]) -> usize {
    // So few are counted together that a byte holds their number, and many bytes are added at once.
    cells.chunks(128).map(|cells| usize::from(cells.iter().map(|value| u8::from(is_known(*value))).sum::<u8>())).sum()
}

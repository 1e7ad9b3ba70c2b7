//! How much of a map has changed.

use crate::geometry::{Grid, is_known, is_occupied};
use std::ops::Range;

/// Two grids share their cells if no corner lies farther from one of the other's than this, in cells.
const TOLERANCE: f64 = 0.01;

/// The number of cells that are unknown, occupied, or neither in one map and not in the other, as a share of the cells known
/// in `before`. What a grid does not reach is unknown. Infinite if the cells of the maps do not coincide, or nothing was
/// known before and something is.
pub fn changed_share(before: &Grid<'_>, after: &Grid<'_>) -> f64 {
    let Some((column, row)) = offset(before, after) else { return f64::INFINITY };
    let (width, height) = (before.geometry.width, before.geometry.height);
    // The rows and columns of `before` that `after` has too.
    let rows = common(height, after.geometry.height, row);
    let columns = common(width, after.geometry.width, column);
    let mut in_common = (0, 0, 0);
    if !columns.is_empty() {
        let first = columns.start.wrapping_add_signed(-column);
        for number in rows {
            let start = number.wrapping_add_signed(-row) * after.geometry.width + first;
            let one = &before.cells[number * width..][columns.clone()];
            let other = &after.cells[start..start + columns.len()];
            if one != other {
                let changed = one.iter().zip(other).filter(|(one, other)| kind_of(**one) != kind_of(**other));
                in_common.0 += changed.count();
            }
            in_common.1 += known(one);
            in_common.2 += known(other);
        }
    }
    let (known_before, known_after) = (known(before.cells), known(after.cells));
    let changed = in_common.0 + (known_before - in_common.1) + (known_after - in_common.2);
    match (changed, known_before) {
        (0, _) => 0.0,
        (_, 0) => f64::INFINITY,
        (changed, known_before) => changed as f64 / known_before as f64,
    }
}

/// The cell of `before` that cell (0, 0) of `after` is, if the cells coincide.
fn offset(before: &Grid<'_>, after: &Grid<'_>) -> Option<(isize, isize)> {
    let resolution = before.geometry.resolution;
    let to_before = before.geometry.origin.inverse() * after.geometry.origin;
    let place = to_before.translation.vector / resolution;
    // How far the cell that is farthest from the corner is off.
    let longest = after.geometry.width.max(after.geometry.height) as f64;
    let scale = after.geometry.resolution / resolution;
    let off =
        (place - place.map(f64::round)).amax() + longest * ((scale - 1.0).abs() + to_before.rotation.angle().abs());
    let is_near = place.amax() < 1e9 && off <= TOLERANCE;
    is_near.then(|| (place.x.round() as isize, place.y.round() as isize))
}

/// The part of `0..count` that another range of `other` numbers has too which begins at `offset`.
fn common(count: usize, other: usize, offset: isize) -> Range<usize> {
    let start = offset.max(0) as usize;
    let end = other.checked_add_signed(offset).unwrap_or(0).min(count);
    start.min(end)..end
}

fn kind_of(value: i8) -> (bool, bool) {
    (is_known(value), is_occupied(value))
}

fn known(cells: &[i8]) -> usize {
    cells.iter().filter(|value| is_known(**value)).count()
}

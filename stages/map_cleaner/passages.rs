//! Known space that is too narrow for a robot to have seen it well.

use crate::geometry::{Grid, is_known};

/// Whether each cell is known and lies in a square of `2 * radius + 1` known cells: the morphological opening of the known
/// space by that square (Serra 1982). Beyond the border of the grid all is known, so that a map that is cut off there
/// loses nothing.
pub(super) fn wide_known_space(grid: &Grid<'_>, radius: usize) -> Vec<bool> {
    let (width, height) = (grid.geometry.width, grid.geometry.height);
    let known: Vec<bool> = grid.cells.iter().map(|value| is_known(*value)).collect();
    let eroded = spread_unknown(known, width, height, radius, false);
    spread_unknown(eroded, width, height, radius, true)
}

/// Spreads what is `spread` by `radius` cells along rows, and then along columns.
fn spread_unknown(mut cells: Vec<bool>, width: usize, height: usize, radius: usize, spread: bool) -> Vec<bool> {
    if width == 0 || height == 0 {
        return cells;
    }
    let mut line = Vec::with_capacity(width);
    for row in cells.chunks_mut(width) {
        if row.contains(&spread) {
            line.clear();
            line.extend_from_slice(row);
            spread_line(&line, radius, spread, |place| row[place] = spread);
        }
    }
    // Row by row, as memory lies: how far the last cell to spread lies above, and then below, each column.
    let mut since = vec![usize::MAX; width];
    let source = cells.clone();
    let rows: [Box<dyn Iterator<Item = usize>>; 2] = [Box::new(0..height), Box::new((0..height).rev())];
    for rows in rows {
        since.fill(usize::MAX);
        for row in rows {
            let start = row * width;
            for ((since, from), cell) in since.iter_mut().zip(&source[start..]).zip(&mut cells[start..]) {
                *since = if *from == spread { 0 } else { since.saturating_add(1) };
                if *since <= radius {
                    *cell = spread;
                }
            }
        }
    }
    cells
}

fn spread_line(line: &[bool], radius: usize, spread: bool, mut set: impl FnMut(usize)) {
    let mut until = 0;
    for (place, _) in line.iter().enumerate().filter(|(_, value)| **value == spread) {
        let last = (place + radius).min(line.len() - 1);
        for place in until.max(place.saturating_sub(radius))..=last {
            set(place);
        }
        until = last + 1;
    }
}

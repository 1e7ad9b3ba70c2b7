//! Reduces a map to its walls and the space between them.

use super::MapCleanerParameters;
use super::objects::each_loose_segment;
use super::passages::wide_known_space;
use crate::shared::geometry::{CellBox, Grid, UNKNOWN, is_known, is_occupied};

/// Sets everything that is no wall to unknown in `cells`, a copy of the cells of `grid`: unknown cells are no
/// evidence for or against a relative pose of two maps.
///
/// - Occupied cells that belong to no wall: people, legs of chairs, dust, and the ends of beams without a hit.
/// - Known space that is narrower than a robot, such as rays through glass and open doors. Walls stay.
pub fn clean(grid: &Grid<'_>, parameters: &MapCleanerParameters, cells: &mut [i8]) {
    let radius = (0.5 * parameters.min_passage / grid.geometry.resolution).min(1e6) as usize;
    if let (true, Some(known_box)) = (radius > 0, CellBox::holding(grid, is_known)) {
        let wide = wide_known_space(grid, &known_box, radius);
        for (row, wide) in known_box.rows.clone().zip(wide.chunks_exact(known_box.columns.len())) {
            let start = row * grid.geometry.width;
            let places = start + known_box.columns.start..start + known_box.columns.end;
            for ((value, is_wide), was) in cells[places.clone()].iter_mut().zip(wide).zip(&grid.cells[places]) {
                if !is_wide && !is_occupied(*was) {
                    *value = UNKNOWN;
                }
            }
        }
    }
    each_loose_segment(grid, parameters, |row, columns| {
        let start = row * grid.geometry.width;
        for place in columns.map(|column| start + column) {
            if is_occupied(grid.cells[place]) {
                cells[place] = UNKNOWN;
            }
        }
    });
}

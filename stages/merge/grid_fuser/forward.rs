//! Fusion by forward mapping of every cell to the output (Tsardoulias et al., section 4.4).
//!
//! Rounding turned cells leaves gaps (equations 14, 15), which a conditional mean closes.

use super::evidence::{CellEvidence, EvidenceTable};
use super::{Fused, KnownArea, PlacedGrid};
use crate::shared::geometry::{Cell, GridGeometry, UNKNOWN, is_known, is_occupied};
use rayon::prelude::*;

/// Least number of known neighbours, of eight, for an unknown cell to be a gap. The border of a straight or rounded
/// area has at most five, and gaps are single or in pairs.
const GAP_NEIGHBOURS: usize = 6;

/// Writes the fused map of `maps` and their conflicts to `fused`, the rows of `geometry`: each map is transformed,
/// its gaps are closed, and the evidence is added.
pub fn fuse(maps: &[(PlacedGrid<'_>, &KnownArea)], geometry: &GridGeometry, table: &EvidenceTable, fused: Fused<'_>) {
    let mut evidence = vec![CellEvidence::NONE; fused.cells.len()];
    for (map, _) in maps {
        let carried = close_gaps(&carry(map, geometry), geometry);
        evidence.par_iter_mut().zip(carried).for_each(|(evidence, value)| table.add(evidence, value));
    }
    fused.cells.par_iter_mut().zip(&evidence).for_each(|(cell, evidence)| *cell = table.value(*evidence));
    fused.conflicts.par_iter_mut().zip(&evidence).for_each(|(cell, evidence)| *cell = table.conflict(*evidence));
}

/// The known cells of a map on the cells of `geometry` that contain their centres (equation 15). Of several in one
/// cell, the most occupied one counts.
pub fn carry(map: &PlacedGrid<'_>, geometry: &GridGeometry) -> Vec<i8> {
    let mut carried = vec![UNKNOWN; geometry.cell_count()];
    let width = map.grid.geometry.width.max(1);
    for (index, &value) in map.grid.cells.iter().enumerate().filter(|(_, value)| is_known(**value)) {
        let cell = Cell { column: index % width, row: index / width };
        let centre = match map.deformation {
            None => map.transform_world_map * map.grid.geometry.centre(cell),
            Some(deformation) => map.transform_world_map * deformation.apply(&map.grid.geometry.centre(cell)),
        };
        let Some(place) = geometry.cell(&centre).and_then(|cell| carried.get_mut(geometry.index(cell))) else {
            continue;
        };
        *place = value.max(*place);
    }
    carried
}

/// Gives every gap the mean of the free and undecided cells among its neighbours (equation 16 under the conditions at
/// the end of section 4.4: neither walls nor known cells spread).
///
/// A gap is an unknown cell most of whose neighbours are known. A gap among occupied cells only takes their mean.
pub fn close_gaps(cells: &[i8], geometry: &GridGeometry) -> Vec<i8> {
    let (width, height) = (geometry.width, geometry.height);
    let mut closed = cells.to_vec();
    if width == 0 || cells.len() != geometry.cell_count() {
        return closed;
    }
    closed.par_chunks_mut(width).enumerate().for_each(|(row, closed)| {
        for (column, value) in closed.iter_mut().enumerate().filter(|(_, value)| **value == UNKNOWN) {
            let rows = row.saturating_sub(1)..(row + 2).min(height);
            let columns = column.saturating_sub(1)..(column + 2).min(width);
            let block = rows.flat_map(|row| &cells[row * width..][columns.clone()]);
            let (mut free, mut occupied) = (Sum::default(), Sum::default());
            for &neighbour in block.filter(|value| **value != UNKNOWN) {
                if is_occupied(neighbour) { occupied.add(neighbour) } else { free.add(neighbour) }
            }
            if free.count + occupied.count >= GAP_NEIGHBOURS {
                *value = if free.count > 0 { free.mean() } else { occupied.mean() };
            }
        }
    });
    closed
}

#[derive(Default)]
struct Sum {
    sum: i32,
    count: usize,
}

impl Sum {
    fn add(&mut self, value: i8) {
        self.sum += i32::from(value);
        self.count += 1;
    }

    fn mean(&self) -> i8 {
        (f64::from(self.sum) / self.count.max(1) as f64).round() as i8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::Pose2;

    #[test]
    fn grids_without_cells_have_no_gaps() {
        let geometry = GridGeometry { width: 0, height: 0, resolution: 1.0, origin: Pose2::identity() };
        assert!(close_gaps(&[], &geometry).is_empty());
    }
}

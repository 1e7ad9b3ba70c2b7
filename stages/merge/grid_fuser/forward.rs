//! Fusion by forward mapping of every cell to the output (Tsardoulias et al., section 4.4).
//!
//! Rounding turned cells leaves gaps (equations 14, 15), which a conditional mean closes.

use super::evidence::{Evidence, EvidenceTable};
use super::{Fused, KnownArea, PlacedGrid};
use crate::shared::geometry::{Cell, GridGeometry, UNKNOWN, is_known, is_occupied};
use rayon::prelude::*;

/// Least number of known neighbours, of eight, for an unknown cell to be a gap. The border of a straight or rounded
/// area has at most five, and gaps are single or in pairs.
const GAP_NEIGHBOURS: usize = 6;

/// Writes the fused map of `maps` and their conflicts to `fused`, the rows of `geometry`: each map is transformed,
/// its gaps are closed, and the evidence is added.
pub fn fuse(maps: &[(PlacedGrid<'_>, &KnownArea)], geometry: &GridGeometry, table: &EvidenceTable, fused: Fused<'_>) {
    let mut evidence = vec![Evidence::NONE; fused.cells.len()];
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
    use crate::shared::geometry::{Grid, Pose2, pose};
    use nalgebra::{Isometry2, Translation2};

    /// The paper's points are integers, and a grid's are the centres of its cells.
    fn golden_area(value: i8) -> (Vec<i8>, GridGeometry, Pose2, GridGeometry) {
        let area = GridGeometry { width: 5, height: 5, resolution: 1.0, origin: pose(97.5, 97.5, 0.0) };
        let turn = Isometry2::rotation(30f64.to_radians());
        let transform = Translation2::new(300.0, 300.0) * turn * Translation2::new(-200.0, -200.0);
        let output = GridGeometry { width: 400, height: 400, resolution: 1.0, origin: pose(0.0, 0.0, 0.0) };
        (vec![value; 25], area, transform, output)
    }

    fn known(cells: &[i8]) -> usize {
        cells.iter().filter(|value| **value != UNKNOWN).count()
    }

    #[test]
    fn equation_15_leaves_23_cells_with_two_holes_and_the_mean_closes_both() {
        let (cells, area, transform_world_map, output) = golden_area(0);
        let map = PlacedGrid::rigid(Grid::new(area, &cells).unwrap(), transform_world_map);
        let carried = carry(&map, &output);
        assert_eq!(known(&carried), 23);
        let closed = close_gaps(&carried, &output);
        assert_eq!(known(&closed), 25);
        let holes: Vec<usize> = (0..closed.len()).filter(|&index| carried[index] != closed[index]).collect();
        for hole in holes {
            // Four known sides make it a hole.
            for side in [hole - 1, hole + 1, hole - 400, hole + 400] {
                assert_ne!(carried[side], UNKNOWN);
            }
            assert_eq!(closed[hole], 0);
        }
    }

    #[test]
    fn the_mean_spreads_neither_walls_nor_the_known_area() {
        let geometry = GridGeometry { width: 5, height: 3, resolution: 1.0, origin: Pose2::identity() };
        #[rustfmt::skip]
        let cells = [
            100, 100, 100, -1, -1,
             10,  -1,  10, -1, -1,
             20,  20,  20, -1, -1,
        ];
        let mut expected = cells;
        expected[6] = 16;
        assert_eq!(close_gaps(&cells, &geometry), expected);
    }

    #[test]
    fn a_gap_in_a_thick_wall_is_wall() {
        let geometry = GridGeometry { width: 3, height: 3, resolution: 1.0, origin: Pose2::identity() };
        let mut cells = [90; 9];
        cells[4] = UNKNOWN;
        assert_eq!(close_gaps(&cells, &geometry), [90; 9]);
    }

    #[test]
    fn grids_without_cells_have_no_gaps() {
        let geometry = GridGeometry { width: 0, height: 0, resolution: 1.0, origin: Pose2::identity() };
        assert!(close_gaps(&[], &geometry).is_empty());
    }
}

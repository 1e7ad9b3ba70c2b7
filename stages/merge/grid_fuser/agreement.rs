//! Areas of a fused map that one map knows, that several know, and that are in conflict.

use crate::shared::geometry::{UNKNOWN, is_known};
use gridweave_runtime::ros::{Header, MapAgreement};
use rayon::prelude::*;
use std::ops::Add;

/// Least conflict value at which a cell counts as in conflict: half of that of two maps that are certain of opposite
/// states. Two maps of values 0 and 100 only are in conflict where one has a wall, and the other free space.
pub const IN_CONFLICT: i8 = 50;
/// Number of cells that are counted at a time.
const BLOCK: usize = 1 << 16;

/// Counts of the cells of a fused map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCounts {
    /// Cells that only one map knows.
    pub known_to_one: u64,
    /// Cells that several maps know, including those in conflict.
    pub known_to_several: u64,
    /// Cells in which maps are in conflict.
    pub in_conflict: u64,
}

impl CellCounts {
    /// Counts the cells of a fused map and of its conflicts, which have the same size.
    pub fn of(cells: &[i8], conflicts: &[i8]) -> Self {
        let blocks = cells.par_chunks(BLOCK).zip(conflicts.par_chunks(BLOCK));
        blocks.map(|(cells, conflicts)| Self::of_block(cells, conflicts)).reduce(Self::default, Self::add)
    }

    fn of_block(cells: &[i8], conflicts: &[i8]) -> Self {
        let count = |holds: fn(i8) -> bool, cells: &[i8]| cells.iter().filter(|cell| holds(**cell)).count() as u64;
        let known_to_several = count(|conflict| conflict != UNKNOWN, conflicts);
        Self {
            known_to_one: count(is_known, cells).saturating_sub(known_to_several),
            known_to_several,
            in_conflict: count(|conflict| conflict >= IN_CONFLICT, conflicts),
        }
    }

    /// The areas as a message, for cells of `cell_area` square metres.
    pub fn message(&self, header: Header, cell_area: f64) -> MapAgreement {
        let area = |cells: u64| cells as f64 * cell_area;
        MapAgreement {
            header,
            known_to_one: area(self.known_to_one),
            known_to_several: area(self.known_to_several),
            in_conflict: area(self.in_conflict),
        }
    }
}

impl Add for CellCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            known_to_one: self.known_to_one + other.known_to_one,
            known_to_several: self.known_to_several + other.known_to_several,
            in_conflict: self.in_conflict + other.in_conflict,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_counted_once() {
        let agreement = CellCounts::of(&[-1, 0, 100, 0, 50, 80, 0], &[-1, -1, -1, 0, 100, 50, 49]);
        assert_eq!(agreement, CellCounts { known_to_one: 2, known_to_several: 4, in_conflict: 2 });
        assert_eq!(CellCounts::of(&[], &[]), CellCounts::default());
    }

    #[test]
    fn blocks_add_up() {
        let (cells, conflicts) = (vec![0; 3 * BLOCK + 7], vec![100; 3 * BLOCK + 7]);
        let all = (3 * BLOCK + 7) as u64;
        let expected = CellCounts { known_to_one: 0, known_to_several: all, in_conflict: all };
        assert_eq!(CellCounts::of(&cells, &conflicts), expected);
    }
}

//! Cell values as log-odds, their sum, and their conflict.
//!
//! A cell's value v is the probability v / 100, clamped to a lower and an upper bound; its log-odds are `ln(p / (1 -
//! p))`. Log-odds of several maps add. Unknown cells add nothing. The sum, clamped to the log-odds of the two bounds,
//! becomes a probability again and then a value, where the bounds themselves become 0 and 100. A cell that only one
//! map knows keeps its value.
//!
//! Positive and negative log-odds are added separately, to show conflicts: the sum alone does not distinguish two
//! maps that are certain of opposite states from two that are uncertain.
//!
//! The log-odds are integers of a small unit, so that the sums do not depend on the order of the maps.

use crate::shared::geometry::UNKNOWN;
use crate::shared::log_odds::log_odds;

/// Steps of the integer log-odds per unit of the natural logarithm.
const STEPS: f64 = 256.0;
/// Bound of the log-odds of one map. No probability below 1 - 1e-15 reaches it.
const MOST_STEPS: f64 = 16_384.0;

/// Tables between values and log-odds.
#[derive(Clone, Debug)]
pub struct EvidenceTable {
    /// Evidence of a map's cell, by its value as an unsigned byte.
    of_value: Box<[CellEvidence; 256]>,
    /// The value for every sum from the lowest to the highest.
    values: Vec<i8>,
    /// Log-odds of the two bounds, in steps: the most that one map can add for a free cell, below 0, and for an
    /// occupied one.
    lowest: i32,
    highest: i32,
}

impl EvidenceTable {
    /// Tables for probabilities clamped to `[min_probability, max_probability]`, which must contain one half.
    pub fn new(min_probability: f64, max_probability: f64) -> Self {
        let steps = |probability: f64| {
            let cut = probability.max(min_probability).min(max_probability);
            (STEPS * log_odds(cut)).round().clamp(-MOST_STEPS, MOST_STEPS) as i32
        };
        let (lowest, highest) = (steps(0.0), steps(1.0));
        let value = |sum: i32| match sum {
            _ if sum <= lowest => 0,
            _ if sum >= highest => 100,
            _ => (100.0 / (1.0 + (-f64::from(sum) / STEPS).exp())).round() as i8,
        };
        let of_value = |byte: usize| match u32::try_from(byte) {
            Ok(value @ 0..=100) => CellEvidence::of_one_map(value, steps(f64::from(value) / 100.0)),
            _ => CellEvidence::NONE,
        };
        Self {
            of_value: Box::new(std::array::from_fn(of_value)),
            values: (lowest..=highest.max(lowest)).map(value).collect(),
            lowest,
            highest,
        }
    }

    /// Adds a map's cell. Invalid values and unknown cells, such as -1, add nothing.
    pub fn add(&self, cell: &mut CellEvidence, value: i8) {
        *cell = cell.plus(self.of_value[usize::from(value.cast_unsigned())]);
    }

    /// Value of the evidence.
    pub fn value(&self, cell: CellEvidence) -> i8 {
        match cell.maps {
            0 => UNKNOWN,
            1 => cell.values as i8,
            _ => {
                let sum = i64::from(cell.occupied) - i64::from(cell.free);
                let place = (sum - i64::from(self.lowest)).clamp(0, self.values.len() as i64 - 1);
                self.values[place as usize]
            }
        }
    }

    /// Conflict of the maps: unknown where fewer than two know the cell, 0 where all agree, and up to 100.
    ///
    /// The log-odds for occupied and those for free are divided by the most that one map can add for each (its
    /// bound), clamped to 1. The smaller share counts, in percent. So 100 is where maps of greatest certainty are on
    /// both sides, and uncertain cells are hardly in conflict.
    pub fn conflict(&self, cell: CellEvidence) -> i8 {
        match cell {
            CellEvidence { maps: 0 | 1, .. } => UNKNOWN,
            CellEvidence { occupied: 0, .. } | CellEvidence { free: 0, .. } => 0,
            CellEvidence { occupied, free, .. } => {
                percent(occupied, self.highest.unsigned_abs()).min(percent(free, self.lowest.unsigned_abs()))
            }
        }
    }
}

/// A sum as a share of the most that one map can add, clamped to 1, in percent.
fn percent(sum: u32, most: u32) -> i8 {
    let most = most.max(1);
    ((100 * sum.min(most) + most / 2) / most) as i8
}

/// Evidence of the maps on one cell. All fields are sums over the maps, so that their order does not matter and
/// adding needs no branch; the sums of 200,000 maps fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellEvidence {
    /// Log-odds for occupied, in steps.
    occupied: u32,
    /// Log-odds for free, in steps.
    free: u32,
    /// Number of maps that know it.
    maps: u32,
    /// Sum of their values: the value, if one map knows it.
    values: u32,
}

impl CellEvidence {
    /// No map knows the cell.
    pub const NONE: Self = Self { occupied: 0, free: 0, maps: 0, values: 0 };

    /// One map knows it: its value and its log-odds, above 0 for occupied and below for free.
    fn of_one_map(value: u32, log_odds: i32) -> Self {
        let occupied = log_odds.max(0).unsigned_abs();
        Self { occupied, free: log_odds.min(0).unsigned_abs(), maps: 1, values: value }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            occupied: self.occupied.wrapping_add(other.occupied),
            free: self.free.wrapping_add(other.free),
            maps: self.maps.wrapping_add(other.maps),
            values: self.values.wrapping_add(other.values),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{is_free, is_occupied};
    use proptest::prelude::*;

    fn table() -> EvidenceTable {
        EvidenceTable::new(0.1192, 0.971)
    }

    fn fuse(values: &[i8]) -> i8 {
        let table = table();
        let mut cell = CellEvidence::NONE;
        values.iter().for_each(|&value| table.add(&mut cell, value));
        table.value(cell)
    }

    fn conflict(values: &[i8]) -> i8 {
        let table = table();
        let mut cell = CellEvidence::NONE;
        values.iter().for_each(|&value| table.add(&mut cell, value));
        table.conflict(cell)
    }

    proptest! {
        #[test]
        fn the_order_of_the_maps_does_not_matter(mut values in prop::collection::vec(-1i8..=100, 0..9)) {
            let fused = (fuse(&values), conflict(&values));
            values.sort_unstable();
            prop_assert_eq!((fuse(&values), conflict(&values)), fused);
            values.reverse();
            prop_assert_eq!((fuse(&values), conflict(&values)), fused);
        }

        #[test]
        fn two_maps_are_in_conflict_if_they_are_on_both_sides_of_one_half(one in 0i8..=100, other in 0i8..=100) {
            let is_within = (0..=100).contains(&conflict(&[one, other]));
            prop_assert!(is_within);
            let is_split = (one < 50 && other > 50) || (one > 50 && other < 50);
            prop_assert!(is_split || conflict(&[one, other]) == 0);
            prop_assert!(!((one < 48 && other > 52) || (one > 52 && other < 48)) || conflict(&[one, other]) > 0);
        }

        #[test]
        fn another_map_removes_no_conflict(values in prop::collection::vec(0i8..=100, 2..6), more in -1i8..=100) {
            let all = [values.clone(), vec![more]].concat();
            prop_assert!(conflict(&all) >= conflict(&values));
        }

        #[test]
        fn fewer_than_two_maps_are_in_no_conflict(value in 0i8..=100) {
            prop_assert_eq!(conflict(&[]), -1);
            prop_assert_eq!(conflict(&[value, -1]), -1);
        }

        #[test]
        fn unknown_cells_add_nothing(value in -128i8..=127) {
            let known = if (0..=100).contains(&value) { value } else { -1 };
            prop_assert_eq!(fuse(&[value]), known);
            prop_assert_eq!(fuse(&[-1, value, -1, 101, -128]), known);
        }

        #[test]
        fn a_map_fused_with_itself_keeps_its_classes(value in 0i8..=100) {
            let fused = fuse(&[value, value]);
            prop_assert!(!is_occupied(value) || is_occupied(fused));
            prop_assert!(!is_free(value) || is_free(fused));
        }
    }

    #[test]
    fn any_number_of_maps_can_be_added() {
        assert_eq!(fuse(&[100; 5000]), 100);
        assert_eq!(fuse(&[0; 5000]), 0);
        assert_eq!(conflict(&[[0; 5000], [100; 5000]].concat()), 100);
    }

    #[test]
    fn invalid_bounds_do_no_harm() {
        for (low, high) in [(f64::NAN, 0.9), (0.0, 1.0), (0.9, 0.1), (-1.0, 2.0)] {
            let table = EvidenceTable::new(low, high);
            let mut cell = CellEvidence::NONE;
            (0..=100).for_each(|value| table.add(&mut cell, value));
            let _ = table.value(cell);
            assert!((0..=100).contains(&table.conflict(cell)));
        }
    }
}

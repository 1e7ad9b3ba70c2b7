//! Cell values as log-odds, and their sum.
//!
//! A cell's value v stands for the probability v / 100, cut to a lower and an upper bound; its log-odds are
//! `ln(p / (1 - p))`. Log-odds of several maps add. Unknown cells say nothing. The sum, cut to the log-odds of the two
//! bounds, becomes a probability again and that a value, where the bounds themselves stand for 0 and 100. A cell that
//! one map alone knows keeps its value.
//!
//! The log-odds are whole numbers of a small unit, so that the sum does not depend on the order of the maps.

use crate::geometry::UNKNOWN;

/// Steps of the whole-number log-odds for one unit of the natural logarithm.
const STEPS: f64 = 256.0;
/// The log-odds of one map are within this. No probability below 1 - 1e-15 comes near it.
const MOST_STEPS: f64 = 16_384.0;
/// Sums stay within this, far from the values with a meaning of their own.
const MOST_SUM: i32 = 1 << 30;
/// What [`Evidence`] holds for a cell that no map knows.
const NOTHING: i32 = i32::MIN;
/// A cell that one map knows holds this and the value.
const ONE_MAP: i32 = i32::MAX - 200;

/// The tables that turn values into log-odds and back.
#[derive(Clone, Debug)]
pub struct EvidenceTable {
    log_odds: [i32; 101],
    /// The value for every sum from the lowest to the highest.
    values: Vec<i8>,
    lowest: i32,
}

impl EvidenceTable {
    /// Tables for probabilities cut to `[min_probability, max_probability]`, which must hold one half.
    pub fn new(min_probability: f64, max_probability: f64) -> Self {
        let steps = |probability: f64| {
            let cut = probability.max(min_probability).min(max_probability);
            (STEPS * (cut / (1.0 - cut)).ln()).round().clamp(-MOST_STEPS, MOST_STEPS) as i32
        };
        let (lowest, highest) = (steps(0.0), steps(1.0));
        let value = |sum: i32| match sum {
            _ if sum <= lowest => 0,
            _ if sum >= highest => 100,
            _ => (100.0 / (1.0 + (-f64::from(sum) / STEPS).exp())).round() as i8,
        };
        Self {
            log_odds: std::array::from_fn(|value| steps(value as f64 / 100.0)),
            values: (lowest..=highest.max(lowest)).map(value).collect(),
            lowest,
        }
    }

    /// Adds what a map says of a cell. Values that are none, such as -1, say nothing.
    pub fn add(&self, cell: &mut Evidence, value: i8) {
        let Some(log_odds) = usize::try_from(value).ok().and_then(|value| self.log_odds.get(value)) else { return };
        cell.0 = match cell.0 {
            NOTHING => ONE_MAP + i32::from(value),
            // The earlier value is 0 to 100, since it went in here.
            one if one >= ONE_MAP => self.log_odds[(one - ONE_MAP) as usize] + log_odds,
            sum => (sum + log_odds).clamp(-MOST_SUM, MOST_SUM),
        };
    }

    /// The value that the evidence amounts to.
    pub fn value(&self, cell: Evidence) -> i8 {
        match cell.0 {
            NOTHING => UNKNOWN,
            one if one >= ONE_MAP => (one - ONE_MAP) as i8,
            sum => {
                let place = (i64::from(sum) - i64::from(self.lowest)).clamp(0, self.values.len() as i64 - 1);
                self.values[place as usize]
            }
        }
    }
}

/// What the maps say of one cell so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evidence(i32);

impl Evidence {
    /// No map knows the cell.
    pub const NONE: Self = Self(NOTHING);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{is_free, is_occupied};
    use proptest::prelude::*;

    fn table() -> EvidenceTable {
        EvidenceTable::new(0.1192, 0.971)
    }

    fn fuse(values: &[i8]) -> i8 {
        let table = table();
        let mut cell = Evidence::NONE;
        values.iter().for_each(|&value| table.add(&mut cell, value));
        table.value(cell)
    }

    proptest! {
        #[test]
        fn the_order_of_the_maps_does_not_matter(mut values in prop::collection::vec(-1i8..=100, 0..9)) {
            let fused = fuse(&values);
            values.sort_unstable();
            prop_assert_eq!(fuse(&values), fused);
            values.reverse();
            prop_assert_eq!(fuse(&values), fused);
        }

        #[test]
        fn unknown_says_nothing(value in -128i8..=127) {
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
    fn evidence_adds() {
        assert_eq!(fuse(&[70, 70]), 84);
        assert_eq!(fuse(&[30, 30]), 16);
        assert_eq!(fuse(&[50, 80]), 80);
        assert_eq!(fuse(&[70, 30]), 50);
        assert_eq!(fuse(&[100, 100]), 100);
        assert_eq!(fuse(&[0, 0, 0]), 0);
    }

    #[test]
    fn one_wall_outweighs_one_free_cell_but_not_two() {
        assert!(is_occupied(fuse(&[100, 0])));
        assert!(!is_occupied(fuse(&[100, 0, 0])));
        assert!(is_free(fuse(&[100, 0, 0, 0])));
    }

    #[test]
    fn any_number_of_maps_can_be_added() {
        assert_eq!(fuse(&[100; 5000]), 100);
        assert_eq!(fuse(&[0; 5000]), 0);
    }

    #[test]
    fn bounds_that_are_no_probabilities_do_no_harm() {
        for (low, high) in [(f64::NAN, 0.9), (0.0, 1.0), (0.9, 0.1), (-1.0, 2.0)] {
            let table = EvidenceTable::new(low, high);
            let mut cell = Evidence::NONE;
            (0..=100).for_each(|value| table.add(&mut cell, value));
            let _ = table.value(cell);
        }
    }
}

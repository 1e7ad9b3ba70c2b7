//! Occupancy in log-odds (Saeedi et al., "Group mapping", equation 7).
//!
//! A cell's value v is the probability v / 100, clamped to a lower and an upper bound, so that no cell is certain;
//! its log-odds are `ln(p / (1 - p))`. An unknown cell has log-odds of 0, which is a probability of one half.

use gridweave_stages::shared::geometry::{UNKNOWN, is_known};
use gridweave_stages::shared::log_odds::log_odds;

/// Steps of the table from log-odds to values per unit of the natural logarithm.
const STEPS: f32 = 256.0;

/// Tables between values and log-odds.
#[derive(Clone, Debug)]
pub struct LogOdds {
    /// By value as an unsigned byte.
    of_value: Box<[f32; 256]>,
    /// The value for every step from the lowest log-odds to the highest.
    values: Vec<i8>,
    lowest: f32,
}

impl LogOdds {
    /// Tables for probabilities clamped to `[min_probability, max_probability]`, which must contain one half and
    /// neither 0 nor 1.
    pub fn new(min_probability: f64, max_probability: f64) -> Self {
        let cut = |probability: f64| log_odds(probability.max(min_probability).min(max_probability)) as f32;
        let (lowest, highest) = (cut(0.0), cut(1.0));
        let of_value = |byte: usize| {
            let value = byte as u8 as i8;
            if is_known(value) { cut(f64::from(value) / 100.0) } else { 0.0 }
        };
        let steps = (STEPS * (highest - lowest)).clamp(0.0, 1e5).ceil() as usize;
        let value = |step: usize| {
            let sum = lowest + step as f32 / STEPS;
            // The bounds themselves become 0 and 100.
            match step {
                0 => 0,
                _ if step == steps => 100,
                _ => (100.0 * probability(f64::from(sum))).round() as i8,
            }
        };
        Self { of_value: Box::new(std::array::from_fn(of_value)), values: (0..=steps).map(value).collect(), lowest }
    }

    /// Log-odds of a cell's value: 0 if it is unknown.
    pub fn of(&self, value: i8) -> f32 {
        self.of_value[usize::from(value.cast_unsigned())]
    }

    /// Value of log-odds, 0 to 100; [`UNKNOWN`] if they are not a number.
    pub fn value(&self, log_odds: f32) -> i8 {
        if log_odds.is_nan() {
            return UNKNOWN;
        }
        let step = ((log_odds - self.lowest) * STEPS).round().max(0.0) as usize;
        self.values[step.min(self.values.len() - 1)]
    }
}

/// The probability of log-odds: the inverse of equation 7.
fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_from_log_odds_within_the_bounds() {
        let table = LogOdds::new(0.1192, 0.971);
        for value in 12..=96 {
            assert_eq!(table.value(table.of(value)), value);
        }
        assert_eq!([0, 5, 98, 100].map(|value| table.value(table.of(value))), [0, 0, 100, 100]);
        assert_eq!([-1, -128, 101].map(|value| table.of(value)), [0.0; 3]);
        assert!((f64::from(table.of(100)) - log_odds(0.971)).abs() < 1e-6);
        assert!((f64::from(table.of(0)) - log_odds(0.1192)).abs() < 1e-6);
        let beyond = [-1e9, 1e9, f32::INFINITY, f32::NEG_INFINITY, f32::NAN].map(|sum| table.value(sum));
        assert_eq!(beyond, [0, 100, 100, 0, UNKNOWN]);
    }

    #[test]
    fn invalid_bounds_do_no_harm() {
        for (low, high) in [(f64::NAN, 0.9), (0.0, 1.0), (0.9, 0.1), (-1.0, 2.0)] {
            let table = LogOdds::new(low, high);
            (0..=100).for_each(|value| assert!((-1..=100).contains(&table.value(table.of(value)))));
        }
    }
}

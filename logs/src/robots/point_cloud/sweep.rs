//! The turn of a 3D lidar about its axis: when it measured in which direction.

use std::f64::consts::{PI, TAU};

/// The least number of directions that show how a lidar turned.
const LEAST_DIRECTIONS: usize = 60;
/// The times that a turn can take, seconds: those of lidars are 0.05 to 0.2.
const TURN: std::ops::RangeInclusive<f64> = 0.01..=1.0;
/// The greatest deviation from an even turn, root mean square, radians. A beam of a lidar with many is off by some
/// degrees from the others; a lidar that does not turn is off by more.
const UNEVEN: f64 = 0.1;

/// A lidar's even turn about its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sweep {
    /// The time of the first direction, seconds, as given.
    pub(super) begin: f64,
    /// The first direction, radians.
    pub(super) first: f64,
    /// Radians per second; negative if the lidar turns clockwise.
    pub(super) rate: f64,
}

impl Sweep {
    /// Finds the turn from times (seconds) and directions (radians), by the straight line of least squares through
    /// them. `None` if they are not those of a lidar that turns evenly.
    pub(super) fn of(mut measured: Vec<(f64, f64)>) -> Option<Self> {
        measured.retain(|(time, _)| time.is_finite());
        if measured.len() < LEAST_DIRECTIONS {
            return None;
        }
        measured.sort_by(|one, other| one.0.total_cmp(&other.0));
        let (begin, origin) = measured[0];
        // Directions that go on beyond a whole turn, relative to the first.
        let (mut last, mut turned) = (origin, 0.0);
        for (time, direction) in &mut measured {
            let step = (*direction - last + PI).rem_euclid(TAU) - PI;
            (last, turned) = (*direction, turned + step);
            (*time, *direction) = (*time - begin, turned);
        }
        let count = measured.len() as f64;
        let mean = |value: &dyn Fn(&(f64, f64)) -> f64| measured.iter().map(value).sum::<f64>() / count;
        let (mean_time, mean_direction) = (mean(&|(time, _)| *time), mean(&|(_, direction)| *direction));
        let spread = mean(&|(time, _)| (time - mean_time).powi(2));
        let rate = mean(&|(time, direction)| (time - mean_time) * (direction - mean_direction)) / spread;
        let at_begin = mean_direction - rate * mean_time;
        let uneven = mean(&|(time, direction)| (direction - at_begin - rate * time).powi(2)).sqrt();
        let first = origin + at_begin;
        // Not a number where all times are equal.
        (TURN.contains(&(TAU / rate.abs())) && uneven <= UNEVEN).then_some(Self { begin, first, rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions of a turn from `first` at `rate`, with every third missing, in another order.
    fn turn(first: f64, rate: f64) -> Vec<(f64, f64)> {
        let direction = |time: f64| (first + rate * time + PI).rem_euclid(TAU) - PI;
        let times = (0..500).filter(|number| number % 3 > 0).map(|number| 7.0 + f64::from(number) * 2e-4);
        times.map(|time| (time, direction(time - 7.0))).rev().collect()
    }

    #[test]
    fn a_turn_is_found_in_either_direction() {
        for (first, rate) in [(0.5, 60.0), (-3.0, -62.8), (3.1, 125.0)] {
            let unknown = [(f64::NAN, 0.1), (f64::INFINITY, 2.0)];
            let found = Sweep::of(turn(first, rate).into_iter().chain(unknown).collect()).unwrap();
            assert_eq!(found.begin, 7.0 + 2e-4);
            assert!((found.first - first - rate * 2e-4).abs() < 1e-6, "{found:?}");
            assert!((found.rate - rate).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn what_does_not_turn_evenly_is_no_turn() {
        assert_eq!(Sweep::of(turn(0.0, 60.0)[..50].to_vec()), None);
        assert_eq!(Sweep::of(turn(0.0, 1.0)), None);
        let all_at_once = turn(0.0, 60.0).into_iter().map(|(_, direction)| (1.0, direction));
        assert_eq!(Sweep::of(all_at_once.collect()), None);
        let to_and_fro = turn(0.0, 60.0).into_iter().map(|(time, direction)| (time, direction.abs()));
        assert_eq!(Sweep::of(to_and_fro.collect()), None);
        assert_eq!(Sweep::of(vec![(f64::NAN, 1.0); 100]), None);
    }
}

//! The place and the width of a peak in a row of values.

/// How far the top of a peak may lie from where the truth is, as a share of its half width: fitted to the errors in
/// simulated maps.
const DEVIATION_OF_HALF_WIDTH: f64 = 0.1;

/// A peak in a row of values, in steps of the row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Peak {
    /// Where its top is: that of the parabola through the highest value and its neighbours.
    pub(super) place: f64,
    /// The standard deviation of that.
    pub(super) deviation: f64,
    /// The highest value.
    pub(super) height: f64,
}

impl Peak {
    /// The peak whose highest value has an index. `value` gives the values for all whole numbers, `within` of which on
    /// either side are looked at.
    ///
    /// Its half width is where the values have fallen halfway to the mean of all.
    pub(super) fn at(index: i64, within: i64, mean: f64, value: impl Fn(i64) -> f64) -> Self {
        let height = value(index);
        let (before, after) = (value(index - 1), value(index + 1));
        let curvature = before - 2.0 * height + after;
        let offset = if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
        let half = 0.5 * (height + mean);
        let reach = |side: i64| (1..within).find(|step| value(index + side * step) < half).unwrap_or(within) as f64;
        // Half a step, as between two values nothing is known.
        let half_width = 0.5 * (reach(-1) + reach(1)) - 0.5;
        let deviation = (1.0 / 12.0 + (DEVIATION_OF_HALF_WIDTH * half_width).powi(2)).sqrt();
        Self { place: index as f64 + offset, deviation, height }
    }
}

/// The highest local maxima of values, the highest first, at least `apart` steps from each other. In a circle if
/// `period` is their number.
pub(super) fn highest(values: &[f64], most: usize, apart: f64, period: Option<f64>) -> Vec<usize> {
    let count = values.len();
    let neighbour = |index: usize, side: isize| {
        let wrapped = index.checked_add_signed(side).filter(|index| *index < count);
        match (wrapped, period) {
            (Some(index), _) => values[index],
            (None, Some(_)) => values[if side < 0 { count - 1 } else { 0 }],
            (None, None) => f64::MIN,
        }
    };
    // The first of equals that stand side by side.
    let is_maximum = |index: &usize| values[*index] > neighbour(*index, -1) && values[*index] >= neighbour(*index, 1);
    let mut maxima: Vec<usize> = (0..count).filter(is_maximum).collect();
    maxima.sort_by(|one, other| values[*other].total_cmp(&values[*one]));
    let mut chosen: Vec<usize> = Vec::new();
    for index in maxima {
        let distance = |other: &usize| {
            let straight = other.abs_diff(index) as f64;
            period.map_or(straight, |period| straight.min(period - straight))
        };
        if chosen.len() < most && chosen.iter().all(|other| distance(other) >= apart) {
            chosen.push(index);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_parabola_is_found_between_its_values() {
        let parabola = |index: i64| 100.0 - (index as f64 - 7.3).powi(2);
        let peak = Peak::at(7, 50, 0.0, parabola);
        assert!((peak.place - 7.3).abs() < 1e-9 && peak.height == parabola(7), "{peak:?}");
        // It has fallen to the half 7.07 steps from its top.
        assert!((6.5..7.6).contains(&((peak.deviation.powi(2) - 1.0 / 12.0).sqrt() / DEVIATION_OF_HALF_WIDTH)));
    }

    #[test]
    fn a_plain_has_no_peak_and_a_wide_one_is_as_wide_as_was_looked() {
        let peak = Peak::at(3, 10, 5.0, |_| 5.0);
        assert_eq!((peak.place, peak.height), (3.0, 5.0));
        assert!(peak.deviation.is_finite() && peak.deviation > 0.9);
    }

    #[test]
    fn the_highest_maxima_come_first_and_keep_their_distance() {
        let values = [9.0, 1.0, 7.0, 6.5, 6.8, 2.0, 2.0, 1.0, 3.0, 8.0];
        assert_eq!(highest(&values, 9, 1.0, None), [0, 9, 2, 4]);
        assert_eq!(highest(&values, 9, 3.0, None), [0, 9, 4]);
        assert_eq!(highest(&values, 2, 2.0, Some(10.0)), [0, 2]);
        assert_eq!(highest(&values, 1, 0.0, Some(10.0)), [0]);
        assert!(highest(&[], 3, 1.0, None).is_empty());
    }
}

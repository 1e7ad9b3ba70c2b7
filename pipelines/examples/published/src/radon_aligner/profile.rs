//! Projections of a map's walls on an axis, and the shifts at which two of them fit.

use super::peak_shape::PeakShape;

/// Radius of the mean that is subtracted from a profile, metres.
const SURROUNDINGS: f64 = 1.0;

/// Least distance of two peaks, metres.
const APART: f64 = 0.25;

/// The longest profile, in bins.
const MOST_BINS: f64 = 4096.0;

/// Amount of wall at each position along an axis, above the mean of its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Where the first bin begins, metres along the axis.
    start: f64,
    /// Metres.
    bin: f64,
    values: Vec<f32>,
}

/// A shift at which two profiles fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// By which profile b is moved along the axis, metres.
    pub metres: f64,
    /// The correlation there, in units of no meaning.
    pub height: f64,
    /// The standard deviation of the Gaussian that is as wide as the peak at half its height, metres.
    pub deviation: f64,
}

impl Profile {
    /// The least bins with which a profile of that length is not too long, metres.
    pub fn least_bin(extent: f64) -> f64 {
        extent / MOST_BINS
    }

    /// Of wall at the given places along an axis, metres, in bins of `bin` metres.
    pub fn new(places: impl Iterator<Item = f64> + Clone, bin: f64) -> Self {
        let (low, high) =
            places.clone().fold((f64::MAX, f64::MIN), |(low, high), place| (low.min(place), high.max(place)));
        if high < low {
            return Self { start: 0.0, bin, values: Vec::new() };
        }
        // Room for the surroundings of the first and the last wall.
        let reach = (SURROUNDINGS / bin).ceil().clamp(1.0, MOST_BINS) as usize;
        let start = (low / bin).floor() * bin - (reach + 1) as f64 * bin;
        let mut counts = vec![0f32; ((high - start) / bin) as usize + reach + 2];
        for place in places {
            // Each cell is spread over the two bins whose middles it lies between.
            let place = (place - start) / bin - 0.5;
            let (whole, part) = (place as usize, place.fract() as f32);
            counts[whole] += 1.0 - part;
            counts[whole + 1] += part;
        }
        Self { start, bin, values: above_surroundings(&counts, reach) }
    }

    /// The shifts of profile b, in bins of the same length, at which it fits best: the best first, at most `count`,
    /// each away from the others.
    pub fn shifts(&self, b: &Self, count: usize) -> Vec<Shift> {
        if self.values.is_empty() || b.values.is_empty() {
            return Vec::new();
        }
        // Place `k` of the correlation is the shift by `k - (length of b - 1)` bins.
        let mut correlation = vec![0f32; self.values.len() + b.values.len() - 1];
        for (value, start) in b.values.iter().zip((0..b.values.len()).rev()) {
            let places = &mut correlation[start..start + self.values.len()];
            places.iter_mut().zip(&self.values).for_each(|(sum, other)| *sum += value * other);
        }
        let at =
            |place: isize| usize::try_from(place).ok().and_then(|p| correlation.get(p)).map_or(0.0, |v| f64::from(*v));
        let is_peak = |place: &isize| at(*place) > 0.0 && at(*place) > at(place - 1) && at(*place) >= at(place + 1);
        let mut peaks: Vec<isize> = (0..correlation.len() as isize).filter(is_peak).collect();
        peaks.sort_by(|one, other| at(*other).total_cmp(&at(*one)).then(one.cmp(other)));
        let apart = APART / self.bin;
        let mut taken: Vec<isize> = Vec::with_capacity(count);
        for peak in peaks {
            if taken.len() < count && taken.iter().all(|other| (peak - other).abs() as f64 > apart) {
                taken.push(peak);
            }
        }
        let shift = |peak: isize| {
            let shape = PeakShape::of(|offset| at(peak + offset), correlation.len());
            let bins = peak as f64 + shape.offset - (b.values.len() - 1) as f64;
            let metres = bins * self.bin + self.start - b.start;
            Shift { metres, height: at(peak), deviation: shape.deviation * self.bin }
        };
        taken.into_iter().map(shift).collect()
    }
}

/// What each value is above the mean of those within `reach`.
fn above_surroundings(values: &[f32], reach: usize) -> Vec<f32> {
    let mut sums = Vec::with_capacity(values.len() + 1);
    sums.push(0f64);
    for value in values {
        sums.push(sums[sums.len() - 1] + f64::from(*value));
    }
    let above = |(place, value): (usize, &f32)| {
        let (low, high) = (place.saturating_sub(reach), (place + reach + 1).min(values.len()));
        value - ((sums[high] - sums[low]) / (2 * reach + 1) as f64) as f32
    };
    values.iter().enumerate().map(above).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Walls at some places, of some lengths.
    fn walls(shift: f64) -> Vec<f64> {
        let places = [(0.0, 40), (3.1, 25), (4.4, 10), (9.7, 33), (15.0, 40)];
        places.iter().flat_map(|&(place, cells)| std::iter::repeat_n(place + shift, cells)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn the_shift_between_two_profiles_is_found_to_a_part_of_a_bin(a in -50.0..50.0, b in -50.0..50.0) {
            let (a_profile, b_profile) =
                (Profile::new(walls(a).into_iter(), 0.05), Profile::new(walls(b).into_iter(), 0.05));
            let shifts = a_profile.shifts(&b_profile, 5);
            prop_assert!((shifts[0].metres - (a - b)).abs() < 0.02, "{} for {}", shifts[0].metres, a - b);
            prop_assert!(shifts.windows(2).all(|two| two[0].height >= two[1].height));
            prop_assert!(shifts[0].deviation < 0.1, "{}", shifts[0].deviation);
        }
    }

    #[test]
    fn a_profile_without_walls_fits_nowhere() {
        let (nothing, some) = (Profile::new(std::iter::empty(), 0.05), Profile::new(walls(0.0).into_iter(), 0.05));
        assert_eq!(nothing.shifts(&some, 5), []);
        assert_eq!(some.shifts(&nothing, 5), []);
        assert!(some.shifts(&some, 0).is_empty());
    }

    #[test]
    fn one_wall_fits_on_each_of_several() {
        let (one, several) = (Profile::new([7.0; 20].into_iter(), 0.05), Profile::new(walls(0.0).into_iter(), 0.05));
        let mut shifts: Vec<i32> = several.shifts(&one, 5).iter().map(|s| (10.0 * s.metres).round() as i32).collect();
        shifts.sort_unstable();
        assert_eq!(shifts, [-70, -39, -26, 27, 80]);
    }
}

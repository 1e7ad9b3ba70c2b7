//! The top and the width of a peak of a correlation.

/// The width of a Gaussian at half its height, in standard deviations: `2 sqrt(2 ln 2)`.
const HALF_HEIGHT_WIDTH: f64 = 2.354_820_045;

/// The shape of a peak, in steps of the values that it is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PeakShape {
    /// Where the top of the parabola through the greatest value and its neighbours lies, from the greatest value.
    pub(super) offset: f64,
    /// The standard deviation of the Gaussian that is as wide at half its height.
    pub(super) deviation: f64,
}

impl PeakShape {
    /// The shape of the peak at 0 of the values `at`, which are looked at up to `most` steps on both sides.
    pub(super) fn of(at: impl Fn(isize) -> f64, most: usize) -> Self {
        let (before, height, after) = (at(-1), at(0), at(1));
        let second_difference = before - 2.0 * height + after;
        let offset = if second_difference < 0.0 { 0.5 * (before - after) / second_difference } else { 0.0 };
        let half_width = |side: isize| {
            let below = (1..=most as isize).find(|step| at(side * step) < 0.5 * height);
            below.map_or(most as f64, |step| {
                let (outer, inner) = (at(side * step), at(side * (step - 1)));
                step as f64 - (0.5 * height - outer) / (inner - outer)
            })
        };
        Self { offset: offset.clamp(-0.5, 0.5), deviation: (half_width(-1) + half_width(1)) / HALF_HEIGHT_WIDTH }
    }
}

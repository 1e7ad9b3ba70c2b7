//! The interpretation of the shades of a map's image as occupancy.

use super::Mode;
use super::middle_grey::unknown_middle;
use super::shades::{ShadeCounts, Shades, is_transparent};
use super::warning::{MapFileWarning, Misread, UnknownGrey};
use gridweave_runtime::ros::cell;
use std::ops::RangeInclusive;

/// The shade in which map savers write unknown cells.
const UNKNOWN_SHADE: usize = 205;
/// The distance from the shade of unknown cells at which a JPEG has them, too.
const LOSSY_SPREAD: usize = 4;
/// The minimum share of the shade of unknown cells that its neighbours have where an image was a JPEG once.
const LEAST_NOISE: f64 = 0.01;
/// The minimum occupancy, above that of unknown, at which the darkest shade of an image is occupied.
const LEAST_CONTRAST: f64 = 0.1;

/// The treatment of a map file's thresholds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Thresholds {
    /// Applied literally, as by a map server.
    Literal,
    /// Corrected by the image where the two disagree: nav2's map saver writes unknown cells in grey 205 with
    /// `free_thresh: 0.25`, which makes them free; walls in grey may be below `occupied_thresh`; and a map server takes
    /// the opacity of a trinary image for a colour.
    #[default]
    ByPicture,
}

/// The interpretation of shades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) mode: Mode,
    /// Whether white is occupied.
    pub(super) negate: bool,
    /// Occupied above this occupancy, 0 to 1.
    pub(super) occupied_thresh: f64,
    /// Free below this occupancy, 0 to 1.
    pub(super) free_thresh: f64,
    /// The first and the last shade that are unknown whatever the thresholds, 0 for black to 1 for white.
    pub(super) unknown: Option<(f64, f64)>,
    /// Whether transparent pixels of a trinary image are unknown, and the colours alone count in the others; if not,
    /// opacity counts as a colour.
    pub(super) transparent_is_unknown: bool,
}

impl Reading {
    /// The interpretation corrected by the image, and the corrections.
    pub(super) fn by_picture(self, shades: &Shades) -> (Self, MapFileWarning) {
        let has_opacity = shades.has_opacity();
        // With this mode, opacity marks unknown cells.
        if self.mode == Mode::Scale && has_opacity {
            return (self, MapFileWarning::default());
        }
        let ShadeCounts { mut greys, transparent } = shades.histogram();
        // `raw` has no thresholds.
        if self.mode == Mode::Raw {
            return (self, MapFileWarning { shaded: shaded_as_others(&greys), ..Default::default() });
        }
        if self.negate {
            greys.reverse();
        }
        // 16 bits for each of 8 make 204 of 205.
        let shade = if greys[UNKNOWN_SHADE] > 0 { UNKNOWN_SHADE } else { UNKNOWN_SHADE - 1 };
        let is_noisy = self.mode == Mode::Trinary && !shades.is_lossy() && has_noise_about(&greys, shade);
        let spread = if shades.is_lossy() || is_noisy { LOSSY_SPREAD } else { 0 };
        let range = shade - spread..=shade + spread;
        // The shade is a peak of the histogram, and not part of a gradient.
        let stands_out = greys[shade] > greys[shade - spread - 1].max(greys[shade + spread + 1]);
        // The map server averages opacity with the colours.
        let literally = |shade: usize| if has_opacity { 0.75 * occupancy_of(shade) } else { occupancy_of(shade) };
        // The histogram is reversed already.
        let of_histogram = Self { negate: false, ..self };
        let is_free = |shade: &usize| match self.mode {
            // A small occupancy is free space as well as none.
            Mode::Scale => cell::is_free(of_histogram.cell(&[*shade as f64], None, 255.0)),
            _ => literally(*shade) < self.free_thresh,
        };
        let misread: u64 = range.clone().filter(is_free).map(|shade| greys[shade]).sum();
        let of_map_saver =
            (stands_out && misread > 0).then_some((range.clone(), misread, Misread::Free(self.free_thresh)));
        let middle = || unknown_middle(&greys).filter(|_| !is_noisy && !shades.is_lossy());
        let unknown = of_map_saver.or_else(|| {
            let middle = middle()?;
            let misread = of_histogram.literally(middle, has_opacity)?;
            Some((middle..=middle, greys[middle], misread))
        });
        let darkest = greys.iter().position(|count| *count > 0).map_or(0.0, occupancy_of);
        let above = self.free_thresh.max(occupancy_of(shade));
        let has_grey_walls =
            self.mode == Mode::Trinary && darkest <= self.occupied_thresh && darkest > above + LEAST_CONTRAST;
        let in_image = |range: &RangeInclusive<usize>| {
            let [one, other] =
                [*range.start(), *range.end()].map(|shade| if self.negate { 255 - shade } else { shade });
            (one.min(other), one.max(other))
        };
        let shades_of_unknown = unknown.as_ref().map(|(range, ..)| in_image(range));
        let reading = Self {
            unknown: shades_of_unknown.map(|(first, last)| (grey_of(first), grey_of(last))),
            occupied_thresh: if has_grey_walls { (above + darkest) / 2.0 } else { self.occupied_thresh },
            transparent_is_unknown: has_opacity,
            ..self
        };
        let warning = MapFileWarning {
            unknown: unknown.zip(shades_of_unknown).map(|((_, cells, misread), shades)| UnknownGrey {
                cells,
                shades,
                misread,
                is_noisy,
            }),
            walls: has_grey_walls.then_some((darkest, self.occupied_thresh)),
            transparent: (transparent > 0).then_some(transparent),
            ..Default::default()
        };
        (reading, warning)
    }

    /// What the thresholds make of a shade that is unknown; `None` if it is neither free nor occupied by them.
    fn literally(&self, shade: usize, has_opacity: bool) -> Option<Misread> {
        let opacity = (has_opacity && self.mode == Mode::Trinary).then_some(255.0);
        let cell = self.cell(&[shade as f64; 3], opacity, 255.0);
        if cell::is_free(cell) {
            return Some(Misread::Free(self.free_thresh));
        }
        cell::is_occupied(cell).then_some(Misread::Occupied(self.occupied_thresh))
    }

    /// The cell for a pixel: grey or three colours; the last of an even number of samples is the opacity.
    pub(super) fn pixel(&self, samples: &[f64], white: f64) -> i8 {
        match samples.split_last() {
            Some((opacity, colours)) if samples.len().is_multiple_of(2) => self.cell(colours, Some(*opacity), white),
            _ => self.cell(samples, None, white),
        }
    }

    /// The cell for a pixel with the given colours and opacity.
    fn cell(&self, colours: &[f64], opacity: Option<f64>, white: f64) -> i8 {
        let mean_of = |sum: f64, count: usize| (sum / (count.max(1) as f64) / white).min(1.0);
        let (sum, count) = (colours.iter().sum::<f64>(), colours.len());
        let grey = mean_of(sum, count);
        if self.unknown.is_some_and(|(first, last)| (first - 1e-3..=last + 1e-3).contains(&grey)) {
            return -1;
        }
        if self.transparent_is_unknown && opacity.is_some_and(|opacity| is_transparent(opacity, white)) {
            return -1;
        }
        let shade = match (self.mode, opacity) {
            _ if self.transparent_is_unknown => grey,
            // The map server averages opacity with red, green and blue here.
            (Mode::Trinary, Some(opacity)) if count == 1 => mean_of(3.0 * sum + opacity, 4),
            (Mode::Trinary, Some(opacity)) => mean_of(sum + opacity, count + 1),
            _ => grey,
        };
        let occupancy = if self.negate { shade } else { 1.0 - shade };
        match self.mode {
            Mode::Raw => match (shade * 255.0).round() {
                value if value <= 100.0 => value as i8,
                _ => -1,
            },
            Mode::Scale if opacity.is_some_and(|opacity| opacity < white) => -1,
            _ if occupancy > self.occupied_thresh => 100,
            _ if occupancy < self.free_thresh => 0,
            Mode::Trinary => -1,
            Mode::Scale => {
                let span = self.occupied_thresh - self.free_thresh;
                let share = if span > 0.0 { (occupancy - self.free_thresh) / span } else { 1.0 };
                (share * 100.0).round_ties_even() as i8
            }
        }
    }
}

/// The numbers of pixels in shades that are no occupancy in the mode `raw`, which writes 255 for unknown, and of those
/// that are; `None` where the latter are as many.
fn shaded_as_others(greys: &[u64; 256]) -> Option<(u64, u64)> {
    let (occupancies, shades) = (greys[..=100].iter().sum(), greys[101..255].iter().sum());
    (shades > occupancies).then_some((shades, occupancies))
}

/// Whether the shades beside one that stands out are as frequent as a JPEG makes them, and each rarer than that one.
fn has_noise_about(greys: &[u64; 256], shade: usize) -> bool {
    let beside =
        || (shade - LOSSY_SPREAD..=shade + LOSSY_SPREAD).filter(|other| *other != shade).map(|other| greys[other]);
    // A gradient, or occupancies by degrees, have no such peak.
    let is_peak = beside().all(|count| 4 * count < greys[shade]);
    is_peak && beside().sum::<u64>() as f64 > LEAST_NOISE * greys[shade] as f64
}

/// A shade from 0 to 255 as a fraction of white.
fn grey_of(shade: usize) -> f64 {
    shade as f64 / 255.0
}

fn occupancy_of(shade: usize) -> f64 {
    1.0 - grey_of(shade)
}

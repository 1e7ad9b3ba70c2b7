//! The interpretation of the shades of a map's image as occupancy.

use super::Mode;
use super::shades::Shades;
use super::warning::MapFileWarning;

/// The shade in which map savers write unknown cells.
const UNKNOWN_SHADE: usize = 205;
/// The minimum occupancy, above that of unknown, at which the darkest shade of an image is occupied.
const LEAST_CONTRAST: f64 = 0.1;

/// The treatment of a map file's thresholds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Thresholds {
    /// Applied literally, as by a map server.
    Literal,
    /// Corrected by the image of a trinary file where the two disagree: nav2's map saver writes unknown cells in grey
    /// 205 with `free_thresh: 0.25`, which makes them free; and walls in grey may be below `occupied_thresh`.
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
}

impl Reading {
    /// The interpretation corrected by the image, and the corrections.
    pub(super) fn by_picture(self, shades: &Shades) -> (Self, MapFileWarning) {
        if self.mode != Mode::Trinary || self.negate {
            return (self, MapFileWarning::default());
        }
        let greys = shades.greys();
        let spread = if shades.is_lossy() { 4 } else { 0 };
        let range = UNKNOWN_SHADE - spread..=UNKNOWN_SHADE + spread;
        let cells: u64 = greys[range.clone()].iter().sum();
        // The shade is a peak of the histogram, and not part of a gradient.
        let stands_out =
            greys[UNKNOWN_SHADE] > greys[UNKNOWN_SHADE - spread - 1].max(greys[UNKNOWN_SHADE + spread + 1]);
        let unknown = occupancy_of(UNKNOWN_SHADE);
        let is_free = unknown < self.free_thresh || shades.has_opacity();
        let is_misread = stands_out && cells > 0 && is_free;
        let darkest = greys.iter().position(|count| *count > 0).map_or(0.0, occupancy_of);
        let above = self.free_thresh.max(unknown);
        let has_grey_walls = darkest <= self.occupied_thresh && darkest > above + LEAST_CONTRAST;
        let reading = Self {
            unknown: is_misread.then(|| (grey_of(*range.start()), grey_of(*range.end()))),
            occupied_thresh: if has_grey_walls { (above + darkest) / 2.0 } else { self.occupied_thresh },
            ..self
        };
        let warning = MapFileWarning {
            unknown: is_misread.then_some((cells, self.free_thresh)),
            walls: has_grey_walls.then_some((darkest, self.occupied_thresh)),
            ..Default::default()
        };
        (reading, warning)
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
        let shade = match (self.mode, opacity) {
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

/// A shade from 0 to 255 as a fraction of white.
fn grey_of(shade: usize) -> f64 {
    shade as f64 / 255.0
}

fn occupancy_of(shade: usize) -> f64 {
    1.0 - grey_of(shade)
}

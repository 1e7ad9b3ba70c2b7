//! The image of a map: from shades to cells, as nav2's map server reads them.

use super::Mode;
use super::description::Reading;
use super::raster::{Raster, RasterError, Samples};

/// An image, and the value that stands for white in it.
pub(super) struct Shades {
    raster: Raster,
    white: f64,
}

impl Shades {
    /// Decodes an image file: PGM, PPM, PBM or PNG, told by its first bytes.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, RasterError> {
        let raster = Raster::decode(bytes)?;
        let white = match raster.samples {
            Samples::Eight(_) => f64::from(u8::MAX),
            Samples::Sixteen(_) => f64::from(u16::MAX),
        };
        Ok(Self { raster, white })
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.raster.width, self.raster.height)
    }

    /// The cells, row by row from the image's last row to its first.
    pub(super) fn cells(&self, reading: &Reading) -> Vec<i8> {
        let white = self.white;
        match &self.raster.samples {
            // Most maps: 256 shades, each of which is read once.
            Samples::Eight(samples) if self.raster.channels == 1 => {
                let table: Vec<i8> = (0..=255u8).map(|value| reading.cell(&[f64::from(value)], None, white)).collect();
                self.rows_upward(samples, |pixel| table[usize::from(pixel[0])])
            }
            Samples::Eight(samples) => self.rows_upward(samples, |pixel| reading.pixel(pixel, white)),
            Samples::Sixteen(samples) => self.rows_upward(samples, |pixel| reading.pixel(pixel, white)),
        }
    }

    fn rows_upward<T: Copy>(&self, samples: &[T], cell: impl Fn(&[T]) -> i8) -> Vec<i8> {
        let channels = self.raster.channels.max(1);
        let row = (self.raster.width as usize * channels).max(1);
        let rows = samples.chunks_exact(row).rev();
        rows.flat_map(|row| row.chunks_exact(channels)).map(cell).collect()
    }
}

impl Reading {
    /// The cell of a pixel: grey or three colours, the last of an even number being its opacity.
    fn pixel<T: Copy + Into<f64>>(&self, pixel: &[T], white: f64) -> i8 {
        let mut values = [0.0; 4];
        values.iter_mut().zip(pixel).for_each(|(value, &sample)| *value = sample.into());
        let count = pixel.len().min(4);
        match count % 2 {
            0 if count > 0 => self.cell(&values[..count - 1], Some(values[count - 1]), white),
            _ => self.cell(&values[..count], None, white),
        }
    }

    /// The cell of a pixel with the given colours and opacity.
    fn cell(&self, colours: &[f64], opacity: Option<f64>, white: f64) -> i8 {
        let mean_of = |sum: f64, count: usize| (sum / (count.max(1) as f64) / white).min(1.0);
        let (sum, count) = (colours.iter().sum::<f64>(), colours.len());
        let shade = match (self.mode, opacity) {
            // The map server counts opacity as one more channel beside red, green and blue here.
            (Mode::Trinary, Some(opacity)) if count == 1 => mean_of(3.0 * sum + opacity, 4),
            (Mode::Trinary, Some(opacity)) => mean_of(sum + opacity, count + 1),
            _ => mean_of(sum, count),
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

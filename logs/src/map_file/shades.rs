//! The image of a map: from shades to cells, as nav2's map server reads them.

use super::Mode;
use super::description::Reading;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult};
use std::io::{self, Cursor};

/// What a byte of a file stands for at the most, bytes of the image: eight pixels in a PBM.
const DENSEST_PNM: u64 = 8;
/// The same for a PNG: its compression, deflate, makes at most 1032 bytes of one, and each may be eight pixels.
const DENSEST_PNG: u64 = 8 * 1032;
/// No image takes more, bytes.
const LARGEST: u64 = 512 << 20;

/// An image, and the value that stands for white in it.
pub(super) struct Shades {
    image: DynamicImage,
    white: f64,
}

impl Shades {
    /// Decodes an image file: PGM, PPM, PBM or PNG, told by its first bytes.
    pub(super) fn decode(bytes: &[u8]) -> ImageResult<Self> {
        let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        let densest = if reader.format() == Some(ImageFormat::Png) { DENSEST_PNG } else { DENSEST_PNM };
        let decoder = reader.into_decoder()?;
        // The size is the file's word only.
        if decoder.total_bytes() > densest.saturating_mul(bytes.len() as u64).min(LARGEST) {
            let (width, height) = decoder.dimensions();
            let text = format!("its {} bytes cannot hold the {width} x {height} pixels that it claims", bytes.len());
            return Err(io::Error::new(io::ErrorKind::InvalidData, text).into());
        }
        let image = DynamicImage::from_decoder(decoder)?;
        let bytes_a_channel = image.color().bytes_per_pixel() / image.color().channel_count();
        Ok(Self { image, white: if bytes_a_channel == 1 { 255.0 } else { 65535.0 } })
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.image.width(), self.image.height())
    }

    /// The cells, row by row from the image's last row to its first.
    pub(super) fn cells(&self, reading: &Reading) -> Vec<i8> {
        let white = self.white;
        let channels = usize::from(self.image.color().channel_count());
        match &self.image {
            // Most maps: 256 shades, each of which is read once.
            DynamicImage::ImageLuma8(grey) => {
                let table: Vec<i8> = (0..=255u8).map(|value| reading.cell(&[f64::from(value)], None, white)).collect();
                self.rows_upward(grey.as_raw(), 1, |pixel| table[usize::from(pixel[0])])
            }
            image => match image.as_flat_samples_u8() {
                Some(flat) => self.rows_upward(flat.samples, channels, |pixel| reading.pixel(pixel, white)),
                None => {
                    let flat = image.as_flat_samples_u16();
                    let samples = flat.as_ref().map(|flat| flat.samples).unwrap_or_default();
                    self.rows_upward(samples, channels, |pixel| reading.pixel(pixel, white))
                }
            },
        }
    }

    fn rows_upward<T: Copy>(&self, samples: &[T], channels: usize, cell: impl Fn(&[T]) -> i8) -> Vec<i8> {
        let row = (self.image.width() as usize * channels).max(1);
        let rows = samples.chunks_exact(row).rev();
        rows.flat_map(|row| row.chunks_exact(channels.max(1))).map(cell).collect()
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

//! The image of a map: its conversion from shades to cells, as in nav2's map server.

use gridweave_runtime::memory;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits};
use std::io::{self, Cursor};

/// The maximum number of image bytes per file byte: eight pixels in a PBM.
const DENSEST_PNM: u64 = 8;
/// The same for a PNG: deflate expands a byte to at most 1032 bytes, each of up to eight pixels.
const DENSEST_PNG: u64 = 8 * 1032;
/// The same for a JPEG: a bit for a block of 8 x 8 pixels in each of three colours, two of them at half the width and
/// height.
const DENSEST_JPEG: u64 = 1024;
/// The same for a BMP: a run of 255 pixels of three colours in two bytes.
const DENSEST_BMP: u64 = 384;
/// The maximum number of pixels of an image, and of those of a run together: 800 m by 800 m in cells of 0.05 m.
pub(super) const MOST_PIXELS: u64 = 1 << 28;
/// The maximum size of a decoded image, bytes: the most pixels in 8 bits of red, green, blue and opacity.
const LARGEST_DECODED: u64 = 4 * MOST_PIXELS;
/// The maximum size of what a decoder keeps beside the pixels, such as texts and the colour profile, bytes.
const LARGEST_PROFILE: u64 = 16 << 20;
/// The number of bytes for a pixel beside the image: its cell, and that in the encoded map.
const BYTES_BESIDE: u64 = 2;
/// The image of a larger map must have a known cell among so many, pixels.
const SPARSE_PIXELS: u64 = 1 << 24;
const SPAREST_KNOWN: u64 = 10_000;

/// An image, and the value of white in it.
pub(super) struct Shades {
    image: DynamicImage,
    white: f64,
    is_lossy: bool,
}

/// How many pixels have each shade.
pub(super) struct ShadeCounts {
    /// The grey shades, 0 for black to 255 for white.
    pub(super) greys: [u64; 256],
    /// The number of transparent pixels, which are in none of these.
    pub(super) transparent: u64,
}

/// Whether a pixel of an opacity, 0 to `white`, shows less of itself than of what is behind it.
pub(super) fn is_transparent(opacity: f64, white: f64) -> bool {
    2.0 * opacity < white
}

impl Shades {
    /// Decodes an image file: PGM, PPM, PBM, PNG, BMP or JPEG, recognised by its first bytes. It has at most `room` pixels.
    pub(super) fn decode(bytes: &[u8], room: u64) -> ImageResult<Self> {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(LARGEST_PROFILE);
        reader.limits(limits);
        let format = reader.format();
        let densest = match format {
            Some(ImageFormat::Png) => DENSEST_PNG,
            Some(ImageFormat::Jpeg) => DENSEST_JPEG,
            Some(ImageFormat::Bmp) => DENSEST_BMP,
            _ => DENSEST_PNM,
        };
        let decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        let refuse = |text: String| Err(io::Error::new(io::ErrorKind::InvalidData, text).into());
        // The size is claimed by the file, so it is not trusted.
        if decoder.total_bytes() > densest.saturating_mul(bytes.len() as u64) {
            return refuse(format!(
                "its {} bytes cannot hold the {width} x {height} pixels that it claims",
                bytes.len()
            ));
        }
        if pixels > MOST_PIXELS {
            return refuse(format!(
                "it has {width} x {height} pixels, more than the maximum of {MOST_PIXELS}; crop it"
            ));
        }
        if pixels > room {
            return refuse(format!(
                "its {width} x {height} pixels are more than the {room} that are left for it: the maps of a run have at most \
                 {MOST_PIXELS} together; crop them to what is known"
            ));
        }
        if decoder.total_bytes() > LARGEST_DECODED {
            return refuse(format!(
                "its {width} x {height} pixels take more than {LARGEST_DECODED} bytes; save it in grey of 8 bits"
            ));
        }
        let needed = decoder.total_bytes() + BYTES_BESIDE * pixels;
        if let Some(available) = memory::available().filter(|available| needed > *available) {
            return refuse(format!(
                "its {width} x {height} pixels take {} MB of memory, and {} MB are left; crop it",
                needed >> 20,
                available >> 20
            ));
        }
        let image = DynamicImage::from_decoder(decoder)?;
        let bytes_a_channel = image.color().bytes_per_pixel() / image.color().channel_count();
        let white = if bytes_a_channel == 1 { 255.0 } else { 65535.0 };
        Ok(Self { image, white, is_lossy: format == Some(ImageFormat::Jpeg) })
    }

    /// The number of columns and rows.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.image.width(), self.image.height())
    }

    /// Whether shades are approximate, because of a lossy format.
    pub(super) fn is_lossy(&self) -> bool {
        self.is_lossy
    }

    /// Whether pixels have an opacity.
    pub(super) fn has_opacity(&self) -> bool {
        self.image.color().has_alpha()
    }

    /// The histogram of the shades.
    pub(super) fn histogram(&self) -> ShadeCounts {
        let mut histogram = ShadeCounts { greys: [0; 256], transparent: 0 };
        match &self.image {
            DynamicImage::ImageLuma8(grey) => {
                grey.as_raw().iter().for_each(|shade| histogram.greys[usize::from(*shade)] += 1);
            }
            image => {
                if let Some(flat) = image.as_flat_samples_u8() {
                    self.count(flat.samples, &mut histogram);
                } else if let Some(flat) = image.as_flat_samples_u16() {
                    self.count(flat.samples, &mut histogram);
                }
            }
        }
        histogram
    }

    fn count<T: Copy + Into<f64>>(&self, samples: &[T], histogram: &mut ShadeCounts) {
        let channels = usize::from(self.image.color().channel_count()).max(1);
        let colours = if self.has_opacity() { channels - 1 } else { channels };
        for pixel in samples.chunks_exact(channels) {
            let (colours_of_pixel, opacity) = pixel.split_at(colours);
            if opacity.first().is_some_and(|opacity| is_transparent((*opacity).into(), self.white)) {
                histogram.transparent += 1;
                continue;
            }
            let sum: f64 = colours_of_pixel.iter().map(|value| (*value).into()).sum();
            let shade = 255.0 * sum / (colours.max(1) as f64) / self.white;
            histogram.greys[(shade.round() as usize).min(255)] += 1;
        }
    }

    /// The cells, row by row from the image's last row to its first. `cell` converts a pixel's samples, each from 0 to
    /// `white`.
    ///
    /// # Errors
    /// The image is large, and nearly all of it is unknown.
    pub(super) fn cells(&self, cell: impl Fn(&[f64], f64) -> i8) -> io::Result<Vec<i8>> {
        let (width, height) = self.size();
        let pixels = u64::from(width) * u64::from(height);
        if pixels > SPARSE_PIXELS {
            let mut known = 0_u64;
            self.for_each_cell(&cell, |cell| known += u64::from(cell >= 0));
            if known < pixels / SPAREST_KNOWN {
                let text = format!("only {known} of its {width} x {height} pixels are known; crop it to these");
                return Err(io::Error::new(io::ErrorKind::InvalidData, text));
            }
        }
        let mut cells = Vec::with_capacity(usize::try_from(pixels).unwrap_or(0));
        self.for_each_cell(&cell, |cell| cells.push(cell));
        Ok(cells)
    }

    /// Passes the cells to `take`, in their order in the map.
    fn for_each_cell(&self, cell: &impl Fn(&[f64], f64) -> i8, take: impl FnMut(i8)) {
        let white = self.white;
        let channels = usize::from(self.image.color().channel_count());
        match &self.image {
            // For most maps: 256 shades, each of which is converted once.
            DynamicImage::ImageLuma8(grey) => {
                let table: Vec<i8> = (0..=255u8).map(|value| cell(&[f64::from(value)], white)).collect();
                self.rows_upward(grey.as_raw(), 1, |pixel| table[usize::from(pixel[0])], take)
            }
            image => match image.as_flat_samples_u8() {
                Some(flat) => self.rows_upward(flat.samples, channels, |pixel| of_samples(pixel, white, cell), take),
                None => {
                    let flat = image.as_flat_samples_u16();
                    let samples = flat.as_ref().map(|flat| flat.samples).unwrap_or_default();
                    self.rows_upward(samples, channels, |pixel| of_samples(pixel, white, cell), take)
                }
            },
        }
    }

    fn rows_upward<T>(&self, samples: &[T], channels: usize, cell: impl Fn(&[T]) -> i8, take: impl FnMut(i8)) {
        let row = (self.image.width() as usize * channels).max(1);
        let rows = samples.chunks_exact(row).rev();
        rows.flat_map(|row| row.chunks_exact(channels.max(1))).map(cell).for_each(take);
    }
}

fn of_samples<T: Copy + Into<f64>>(pixel: &[T], white: f64, cell: impl Fn(&[f64], f64) -> i8) -> i8 {
    let mut values = [0.0; 4];
    values.iter_mut().zip(pixel).for_each(|(value, &sample)| *value = sample.into());
    cell(&values[..pixel.len().min(4)], white)
}

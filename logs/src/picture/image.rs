//! An image in red, green and blue, and its PNG file.

use super::PictureError;
use std::path::Path;

/// A colour: red, green and blue.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Rgb(pub [u8; 3]);

/// An image. Columns count from the left, rows from the top.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct RgbImage {
    width: u32,
    height: u32,
    /// Row by row.
    pixels: Vec<Rgb>,
}

impl RgbImage {
    /// An image of one colour.
    pub fn from_pixel(width: u32, height: u32, colour: Rgb) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    /// An image whose pixel in column `u` and row `v` is `colour(u, v)`.
    pub fn from_fn(width: u32, height: u32, mut colour: impl FnMut(u32, u32) -> Rgb) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for v in 0..height {
            pixels.extend((0..width).map(|u| colour(u, v)));
        }
        Self { width, height, pixels }
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Columns and rows.
    pub fn dimensions(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// All pixels, row by row.
    pub(super) fn pixels_mut(&mut self) -> &mut [Rgb] {
        &mut self.pixels
    }

    /// The pixel in column `u` and row `v`, which must lie in the image.
    pub fn pixel(&self, u: u32, v: u32) -> Rgb {
        self.pixels[self.index(u, v)]
    }

    /// Paints the pixel in column `u` and row `v`, which must lie in the image.
    pub fn put_pixel(&mut self, u: u32, v: u32, colour: Rgb) {
        let index = self.index(u, v);
        self.pixels[index] = colour;
    }

    /// Lays an image over this one, its upper left pixel in column `left` and row `top`. It must fit.
    pub(super) fn put_image(&mut self, left: u32, top: u32, image: &Self) {
        for (v, row) in (top..).zip(image.pixels.chunks_exact(image.width.max(1) as usize)) {
            let start = self.index(left, v);
            self.pixels[start..start + row.len()].copy_from_slice(row);
        }
    }

    fn index(&self, u: u32, v: u32) -> usize {
        assert!(u < self.width && v < self.height, "({u}, {v}) lies outside of {} x {}", self.width, self.height);
        v as usize * self.width as usize + u as usize
    }

    /// The image as a PNG file.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let samples: Vec<u8> = self.pixels.iter().flat_map(|pixel| pixel.0).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_filter(png::Filter::Adaptive);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(&samples)?;
            writer.finish()
        });
        written.map_err(|error| PictureError::Png(error.to_string()))?;
        Ok(file)
    }

    /// Writes the image as a PNG file.
    pub fn save_png(&self, path: &Path) -> Result<(), PictureError> {
        std::fs::write(path, self.png()?).map_err(|source| PictureError::Write { path: path.to_owned(), source })
    }
}

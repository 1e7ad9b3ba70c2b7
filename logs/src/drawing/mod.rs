//! Drawings of lines, areas, text and images, written as PNG, SVG or PDF with the same shapes in each.
//!
//! Lengths are pixels, x to the right and y down from the upper left corner. Text is drawn as outlines of its letters,
//! from a font in this crate, so that it looks the same everywhere. The same drawing gives the same bytes.

mod pdf;
mod png;
mod shape;
mod svg;
mod text;

pub use png::encode_png;
pub use shape::{Colour, Group, Paint, Path, Step};
pub use text::{text, text_width};

use image::RgbImage;
use nalgebra::Point2;

/// An axis-aligned rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// The upper left corner.
    pub corner: Point2<f64>,
    /// The size along x.
    pub width: f64,
    /// The size along y.
    pub height: f64,
}

/// An image on white paper, with shapes on it.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The width, pixels.
    pub width: u32,
    /// The height, pixels.
    pub height: u32,
    /// The image below all shapes.
    pub image: RgbImage,
    /// The upper left corner of the image, pixels.
    pub image_at: (u32, u32),
    /// The shapes, in drawing order.
    pub groups: Vec<Group>,
}

impl Drawing {
    /// The area of the image.
    pub fn image_area(&self) -> Rectangle {
        Rectangle {
            corner: Point2::new(f64::from(self.image_at.0), f64::from(self.image_at.1)),
            width: f64::from(self.image.width()),
            height: f64::from(self.image.height()),
        }
    }
}

/// The error when a drawing cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the picture cannot be written as {format}: {cause}")]
pub struct DrawingError {
    format: &'static str,
    cause: String,
}

impl DrawingError {
    fn new(format: &'static str, cause: impl std::fmt::Display) -> Self {
        Self { format, cause: cause.to_string() }
    }
}

#[cfg(test)]
mod tests;

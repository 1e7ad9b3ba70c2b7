//! Drawings of lines, areas, words and images, written as PNG, SVG or PDF: the same shapes in each.
//!
//! Lengths are pixels, x to the right and y down from the upper left corner. Words are drawn as the outlines of their letters,
//! from a font that comes with the crate, so that they look the same everywhere. The same drawing gives the same bytes.

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

/// A rectangle along the sides of a drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Its upper left corner.
    pub corner: Point2<f64>,
    /// Along x.
    pub width: f64,
    /// Along y.
    pub height: f64,
}

/// An image on white paper, and shapes upon it.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// What lies below all shapes.
    pub image: RgbImage,
    /// Where the upper left corner of the image lies: whole pixels.
    pub image_at: (u32, u32),
    /// What is drawn upon it, one after the other.
    pub groups: Vec<Group>,
}

impl Drawing {
    /// Where the image lies.
    pub fn image_area(&self) -> Rectangle {
        Rectangle {
            corner: Point2::new(f64::from(self.image_at.0), f64::from(self.image_at.1)),
            width: f64::from(self.image.width()),
            height: f64::from(self.image.height()),
        }
    }
}

/// Why a drawing cannot be written.
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

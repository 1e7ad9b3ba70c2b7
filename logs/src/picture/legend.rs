//! The legend of a picture's colours.

use super::colour::{OCCUPIED, mix};
use crate::drawing::{Colour, Path, text, text_width};
use image::Rgb;
use nalgebra::Point2;

/// An entry of the legend: a text beside a patch of its colour.
pub(super) struct Entry<'a> {
    pub(super) words: &'a str,
    pub(super) colour: Colour,
}

/// Arranges entries in rows.
pub(super) struct Legend {
    /// The font size, pixels.
    pub(super) size: f64,
    /// The position of the next entry, on its baseline.
    pub(super) next: Point2<f64>,
    /// The left end of rows.
    pub(super) left: f64,
    /// The right end of rows.
    pub(super) right: f64,
    pub(super) paths: Vec<Path>,
}

impl Legend {
    /// The width of an entry, including the gap after it.
    pub(super) fn length(words: &str, size: f64) -> f64 {
        text_width(words, size) + 3.2 * size
    }

    /// The height of a row.
    pub(super) fn row(size: f64) -> f64 {
        1.6 * size
    }

    pub(super) fn add(&mut self, entry: &Entry<'_>) {
        let (size, length) = (self.size, Self::length(entry.words, self.size));
        // Starts a row, unless the current one is empty.
        if self.next.x + length - size > self.right && self.next.x > self.left {
            self.next = Point2::new(self.left, self.next.y + Self::row(size));
        }
        let (x, y) = (self.next.x, self.next.y);
        let patch = [(0.0, 0.0), (1.2, 0.0), (1.2, -0.75), (0.0, -0.75)];
        let corners = patch.map(|(right, up)| Point2::new(x + right * size, y + up * size));
        self.paths.push(Path::area(corners).filled(entry.colour));
        // Text in a light colour would be hard to read.
        let dark = mix(Rgb(entry.colour), OCCUPIED, 0.3).0;
        self.paths.push(text(entry.words, Point2::new(x + 1.6 * size, y), size).filled(dark));
        self.next.x += length;
    }
}

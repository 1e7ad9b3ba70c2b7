//! What the colours of a picture stand for.

use super::colour::{OCCUPIED, mix};
use crate::drawing::{Colour, Path, text, text_width};
use image::Rgb;
use nalgebra::Point2;

/// A word of the legend beside a patch of its colour.
pub(super) struct Entry<'a> {
    pub(super) words: &'a str,
    pub(super) colour: Colour,
}

/// Lays entries beside each other in rows.
pub(super) struct Legend {
    /// Of the letters, pixels.
    pub(super) size: f64,
    /// Where the next entry begins, and the line that it stands on.
    pub(super) next: Point2<f64>,
    /// Where rows begin.
    pub(super) left: f64,
    /// Where they end.
    pub(super) right: f64,
    pub(super) paths: Vec<Path>,
}

impl Legend {
    /// How long an entry is, with the gap behind it.
    pub(super) fn length(words: &str, size: f64) -> f64 {
        text_width(words, size) + 3.2 * size
    }

    /// From one line to the next.
    pub(super) fn row(size: f64) -> f64 {
        1.6 * size
    }

    pub(super) fn add(&mut self, entry: &Entry<'_>) {
        let (size, length) = (self.size, Self::length(entry.words, self.size));
        // Another row, but not an empty one.
        if self.next.x + length - size > self.right && self.next.x > self.left {
            self.next = Point2::new(self.left, self.next.y + Self::row(size));
        }
        let (x, y) = (self.next.x, self.next.y);
        let patch = [(0.0, 0.0), (1.2, 0.0), (1.2, -0.75), (0.0, -0.75)];
        let corners = patch.map(|(right, up)| Point2::new(x + right * size, y + up * size));
        self.paths.push(Path::area(corners).filled(entry.colour));
        // Light colours are hard to read as letters.
        let dark = mix(Rgb(entry.colour), OCCUPIED, 0.3).0;
        self.paths.push(text(entry.words, Point2::new(x + 1.6 * size, y), size).filled(dark));
        self.next.x += length;
    }
}

//! Grid lines with their coordinates.

use super::PictureError;
use super::marks::{Mark, Marks, Shape};
use super::view::View;
use crate::drawing::{Colour, Paint};
use nalgebra::Point2;

/// The maximum number of lines; more would make the picture grey.
const MOST_LINES: f64 = 400.0;
const LINE: Paint = Paint { colour: [60, 60, 60], opacity: 0.3 };
const NUMBER: Colour = [70, 70, 70];

/// Grid lines parallel to the axes of the world every `metres`, labelled with their coordinates.
pub(super) fn grid_lines(view: &View, metres: f64) -> Result<Marks, PictureError> {
    let low = view.world(0.0, f64::from(view.height));
    let high = view.world(f64::from(view.width), 0.0);
    let most = (high.x - low.x).max(high.y - low.y) / metres;
    if !(metres > 0.0 && metres.is_finite() && most <= MOST_LINES) {
        return Err(PictureError::Grid { metres });
    }
    let multiples = |low: f64, high: f64| ((low / metres).ceil() as i64)..=((high / metres).floor() as i64);
    let mut marks = Vec::new();
    let mut add = |from: Point2<f64>, to: Point2<f64>, value: f64| {
        marks.push(Mark { shape: Shape::Line { places: vec![from, to], width: 0.5 }, paint: LINE });
        // The position where the next label has room.
        let words = length_text(value);
        marks.push(Mark { shape: Shape::Label { at: from, words }, paint: NUMBER.into() });
    };
    for x in multiples(low.x, high.x).map(|multiple| multiple as f64 * metres) {
        add(Point2::new(x, low.y), Point2::new(x, high.y), x);
    }
    for y in multiples(low.y, high.y).map(|multiple| multiple as f64 * metres) {
        add(Point2::new(low.x, y), Point2::new(high.x, y), y);
    }
    Ok(Marks { name: format!("a line every {}", length_text(metres)), legend: Some(LINE.colour), marks })
}

/// A length for people, such as `2.5 m`.
pub(super) fn length_text(metres: f64) -> String {
    // Rounded, to hide the inexact last digits of a binary number.
    format!("{} m", (metres * 1e6).round() / 1e6 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_written_without_needless_digits() {
        assert_eq!([20.0, 0.1 + 0.2, 0.05, -0.0].map(length_text), ["20 m", "0.3 m", "0.05 m", "0 m"]);
    }
}

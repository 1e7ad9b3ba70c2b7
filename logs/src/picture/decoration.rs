//! Axes, marks, margin, scale bar and legend.

use super::grid_lines::{grid_lines, length_text};
use super::legend::{Entry, Legend};
use super::marks::text_size;
use super::view::View;
use super::{Cells, Picture, PictureError, Scene};
use crate::drawing::{Colour, Drawing, Group, Path, text, text_width};
use image::RgbImage;
use nalgebra::{Point2, Vector2};

/// The most maps that the legend names: of thousands it would be a hundred times as high as the maps.
const MOST_NAMED: usize = 500;

const INK: Colour = [0, 0, 0];
const X_AXIS: Colour = [200, 30, 30];
const Y_AXIS: Colour = [30, 150, 30];

/// Adds everything that is drawn on the maps and beside them.
pub(super) fn decorate(map: RgbImage, view: &View, scene: &Scene<'_>) -> Result<Picture, PictureError> {
    let unit = view.unit().round();
    let (margin, size) = (8.0 * unit, text_size(unit));
    let corner = Vector2::new(margin, margin);
    let lines = scene.grid.map(|metres| grid_lines(view, metres)).transpose()?;

    let mut groups: Vec<Group> = lines.iter().map(|lines| lines.draw(view, corner)).collect();
    groups.extend(axes(view, corner));
    groups.extend(scene.marks.iter().map(|marks| marks.draw(view, corner)));

    let maps = scene.maps.iter().filter(|map| scene.cells == Cells::Coloured && !map.name.is_empty());
    let mut entries: Vec<Entry<'_>> = maps.map(|map| Entry { words: map.name, colour: map.colour }).collect();
    let others = format!("and {} more", entries.len().saturating_sub(MOST_NAMED));
    if entries.len() > MOST_NAMED {
        entries.truncate(MOST_NAMED);
        entries.push(Entry { words: &others, colour: INK });
    }
    for marks in scene.marks.iter().chain(&lines) {
        if let Some(colour) = marks.legend {
            let entry = Entry { words: &marks.name, colour };
            // Marks of the same kind may be in several groups.
            if !entries.iter().any(|other| other.words == entry.words) {
                entries.push(entry);
            }
        }
    }

    let bar = ScaleBar::new(f64::from(map.width()), view.metres_per_pixel);
    let longest = entries.iter().map(|entry| Legend::length(entry.words, size)).fold(0.0, f64::max);
    let inner = f64::from(map.width()).max(longest).max(bar.width(size)).ceil();
    let top = 2.0 * margin + f64::from(map.height());
    let line = top + size;
    let left = margin + bar.width(size) + 2.0 * size;
    let right = margin + inner + 0.5 * size;
    let mut legend = Legend { size, next: Point2::new(left, line), left: margin, right, paths: Vec::new() };
    entries.iter().for_each(|entry| legend.add(entry));
    groups.push(Group { name: "scale".into(), is_on_image: false, paths: bar.draw(margin, line, size, unit) });
    let bottom = legend.next.y;
    groups.push(Group { name: "legend".into(), is_on_image: false, paths: legend.paths });

    let (width, height) = ((inner + 2.0 * margin) as u32, (bottom + margin).ceil() as u32);
    let image_at = (margin as u32, margin as u32);
    let drawing = Drawing { width, height, image: map, image_at, groups };
    Ok(Picture { drawing, metres_per_pixel: view.metres_per_pixel, scale_bar: bar.metres })
}

/// The axes of the world at its origin, x red and y green; `None` if it is far outside of the picture.
fn axes(view: &View, corner: Vector2<f64>) -> Option<Group> {
    let unit = view.unit();
    let origin = view.pixel(Point2::origin());
    if !(origin.x.abs() < 1e5 && origin.y.abs() < 1e5) {
        return None;
    }
    let origin = origin + corner;
    let axis = |direction: Vector2<f64>, colour: Colour| {
        let tip = origin + direction * 22.0 * unit;
        let side = Vector2::new(direction.y, direction.x) * 3.5 * unit;
        let barb = tip - direction * 6.0 * unit;
        [[origin, tip], [barb + side, tip], [barb - side, tip]]
            .map(|ends| Path::lines(ends).stroked(colour, 2.0 * unit))
    };
    let paths = [axis(Vector2::x(), X_AXIS), axis(-Vector2::y(), Y_AXIS)].concat();
    Some(Group { name: "axes of the world".into(), is_on_image: true, paths })
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `limit`, and the number of its divisions.
fn round_length(limit: f64) -> (f64, u32) {
    let power = 10_f64.powi(limit.log10().floor() as i32);
    match limit / power {
        ratio if ratio >= 5.0 => (5.0 * power, 5),
        ratio if ratio >= 2.0 => (2.0 * power, 4),
        _ => (power, 5),
    }
}

/// A scale bar of a round length, with alternating black and white divisions, and its length as text.
struct ScaleBar {
    metres: f64,
    pixels: f64,
    parts: u32,
    words: String,
}

impl ScaleBar {
    fn new(map_width: f64, metres_per_pixel: f64) -> Self {
        let (metres, parts) = round_length(map_width * metres_per_pixel / 3.0);
        Self { metres, pixels: metres / metres_per_pixel, parts, words: length_text(metres) }
    }

    /// The width including the text, pixels.
    fn width(&self, size: f64) -> f64 {
        self.pixels + 0.6 * size + text_width(&self.words, size)
    }

    /// Draws the bar at `left`, with its text on the baseline `line`.
    fn draw(&self, left: f64, line: f64, size: f64, unit: f64) -> Vec<Path> {
        let (top, bottom) = (line - 0.6 * size, line - 0.6 * size + 4.0 * unit);
        let part = |from: f64, to: f64| {
            Path::area([(from, top), (to, top), (to, bottom), (from, bottom)].map(|(x, y)| Point2::new(left + x, y)))
        };
        let ends = |index: u32| self.pixels * f64::from(index) / f64::from(self.parts);
        let black = (0..self.parts).step_by(2).map(|index| part(ends(index), ends(index + 1)).filled(INK));
        let mut paths: Vec<Path> = black.collect();
        paths.push(part(0.0, self.pixels).stroked(INK, unit * 0.6));
        let start = Point2::new(left + self.pixels + 0.6 * size, line);
        paths.push(text(&self.words, start, size).filled(INK));
        paths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_bar_has_a_round_length() {
        let lengths = [0.09, 0.1, 0.3, 1.0, 1.9, 2.0, 4.9, 7.0, 23.0, 999.0].map(|limit| round_length(limit).0);
        let expected = [0.05, 0.1, 0.2, 1.0, 1.0, 2.0, 2.0, 5.0, 20.0, 500.0];
        for (length, expected) in lengths.into_iter().zip(expected) {
            assert!((length - expected).abs() < 1e-9 * expected, "{length} instead of {expected}");
        }
    }
}

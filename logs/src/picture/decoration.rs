//! Axes, margin and scale bar.

use super::colour::{OCCUPIED, mix};
use super::view::View;
use image::{Rgb, RgbImage};
use nalgebra::{Point2, Vector2};

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const X_AXIS: Rgb<u8> = Rgb([200, 30, 30]);
const Y_AXIS: Rgb<u8> = Rgb([30, 150, 30]);

/// A length for lines and gaps that suits the size of the picture, pixels.
pub(super) fn unit(view: &View) -> f64 {
    (f64::from(view.width.max(view.height)) / 500.0).max(1.0)
}

/// Draws the axes of the world at its origin, x red and y green.
pub(super) fn draw_axes(image: &mut RgbImage, view: &View) {
    let unit = unit(view);
    let origin = view.pixel(Point2::origin());
    if !(origin.x.abs() < 1e6 && origin.y.abs() < 1e6) {
        return;
    }
    for (direction, colour) in [(Vector2::x(), X_AXIS), (-Vector2::y(), Y_AXIS)] {
        let tip = origin + direction * 22.0 * unit;
        let side = Vector2::new(direction.y, direction.x) * 3.5 * unit;
        let barb = tip - direction * 6.0 * unit;
        for (from, to) in [(origin, tip), (barb + side, tip), (barb - side, tip)] {
            draw_line(image, from, to, 2.0 * unit, colour);
        }
    }
}

/// A line with round ends, its edges smoothed.
pub(super) fn draw_line(image: &mut RgbImage, from: Point2<f64>, to: Point2<f64>, thickness: f64, colour: Rgb<u8>) {
    let reach = thickness / 2.0 + 1.0;
    let low = |a: f64, b: f64| (a.min(b) - reach).max(0.0) as u32;
    let high = |a: f64, b: f64, limit: u32| ((a.max(b) + reach).max(0.0) as u32).min(limit);
    let along = to - from;
    for v in low(from.y, to.y)..high(from.y, to.y, image.height()) {
        for u in low(from.x, to.x)..high(from.x, to.x, image.width()) {
            let offset = Point2::new(f64::from(u) + 0.5, f64::from(v) + 0.5) - from;
            let share = (offset.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let distance = (offset - along * share).norm();
            let pixel = image.get_pixel_mut(u, v);
            *pixel = mix(*pixel, colour, thickness / 2.0 + 0.5 - distance);
        }
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `limit`, and into how many parts it is divided.
fn round_length(limit: f64) -> (f64, u32) {
    let power = 10_f64.powi(limit.log10().floor() as i32);
    match limit / power {
        ratio if ratio >= 5.0 => (5.0 * power, 5),
        ratio if ratio >= 2.0 => (2.0 * power, 4),
        _ => (power, 5),
    }
}

/// The picture in a white margin with a scale bar below it, and the length of the bar in metres.
///
/// The bar's parts are black and white in turn.
pub(super) fn frame_with_scale_bar(map: &RgbImage, view: &View) -> (RgbImage, f64) {
    let unit = unit(view).round();
    let (margin, thickness) = ((8.0 * unit) as u32, (4.0 * unit) as u32);
    let foot = 2 * margin + thickness;
    let (width, height) = (map.width() + 2 * margin, map.height() + margin + foot);
    let mut image = RgbImage::from_pixel(width, height, PAPER);
    image::imageops::replace(&mut image, map, i64::from(margin), i64::from(margin));

    let (length, parts) = round_length(f64::from(map.width()) * view.metres_per_pixel / 3.0);
    let (left, top) = (margin, margin + map.height() + margin);
    let pixels = length / view.metres_per_pixel;
    let border = (unit as u32).max(1);
    for u in 0..(pixels.round() as u32).min(map.width()) {
        let part = (f64::from(u) / pixels * f64::from(parts)) as u32;
        for v in 0..thickness {
            let on_border = v < border || v + border >= thickness || u + border >= pixels.round() as u32;
            let colour = if part.is_multiple_of(2) || on_border { OCCUPIED } else { PAPER };
            image.put_pixel(left + u, top + v, colour);
        }
    }
    (image, length)
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

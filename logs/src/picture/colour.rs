//! The colours of a picture.

use super::layer::Coverage;
use crate::drawing::Colour;
use image::Rgb;

pub(super) const UNKNOWN: Rgb<u8> = Rgb([205, 205, 205]);
pub(super) const FREE: Rgb<u8> = Rgb([255, 255, 255]);
pub(super) const OCCUPIED: Rgb<u8> = Rgb([0, 0, 0]);
/// The background of an overlay: lighter than unknown, so that the tints are visible.
const BACKGROUND: Rgb<u8> = Rgb([218, 218, 218]);

/// The share of a map's colour in its free space.
const TINT: f64 = 0.2;
/// The darkening of walls that two maps have in common.
const SHADOW: f64 = 0.45;

/// Interpolates between two colours; `share` is 0 to 1.
pub(super) fn mix(from: Rgb<u8>, to: Rgb<u8>, share: f64) -> Rgb<u8> {
    let share = share.clamp(0.0, 1.0);
    Rgb(std::array::from_fn(|i| (f64::from(from.0[i]) * (1.0 - share) + f64::from(to.0[i]) * share).round() as u8))
}

/// The weighted mean of the maps' colours, and the sum of the weights.
fn weighted_mean(weights: impl Iterator<Item = (Colour, f64)>) -> Option<(Rgb<u8>, f64)> {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (colour, weight) in weights {
        sum.iter_mut().zip(colour).for_each(|(sum, channel)| *sum += weight * f64::from(channel));
        total += weight;
    }
    (total > 0.0).then(|| (Rgb(sum.map(|channel| (channel / total).round() as u8)), total))
}

/// The colour of a pixel of an overlay.
pub(super) fn overlay(shares: &[Coverage], colours: &[Colour]) -> Rgb<u8> {
    let mut colour = BACKGROUND;
    let with_colours = |part: fn(&Coverage) -> f64| colours.iter().copied().zip(shares.iter().map(part));
    if let Some((tint, total)) = weighted_mean(with_colours(|share| share.free)) {
        // Space known to one map has its colour; space known to several is nearly white, so that the overlap is
        // visible.
        colour = mix(colour, mix(FREE, tint, TINT / total.max(1.0).powi(3)), total);
    }
    if let Some((walls, total)) = weighted_mean(with_colours(|share| share.wall)) {
        let strongest = shares.iter().map(|share| share.wall).fold(0.0, f64::max);
        let common = total - strongest;
        colour = mix(colour, mix(walls, OCCUPIED, SHADOW * common.min(1.0)), strongest);
    }
    colour
}

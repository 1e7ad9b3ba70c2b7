//! The colours of a picture.

use super::layer::Coverage;
use crate::drawing::Colour;
use image::Rgb;

pub(super) const UNKNOWN: Rgb<u8> = Rgb([205, 205, 205]);
pub(super) const FREE: Rgb<u8> = Rgb([255, 255, 255]);
pub(super) const OCCUPIED: Rgb<u8> = Rgb([0, 0, 0]);
/// What lies behind the maps of an overlay: lighter, so that the tints stand out.
const BACKGROUND: Rgb<u8> = Rgb([218, 218, 218]);

/// How much of a map's colour its free space has.
const TINT: f64 = 0.2;
/// How much darker walls are that two maps have in common.
const SHADOW: f64 = 0.45;

/// `share`, 0 to 1, of the way from one colour to another.
pub(super) fn mix(from: Rgb<u8>, to: Rgb<u8>, share: f64) -> Rgb<u8> {
    let share = share.clamp(0.0, 1.0);
    Rgb(std::array::from_fn(|i| (f64::from(from.0[i]) * (1.0 - share) + f64::from(to.0[i]) * share).round() as u8))
}

/// The mean of the maps' colours, each with its weight, and the sum of the weights.
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
        // What one map knows has its colour; what several know is nearly white, so that the overlap shows.
        colour = mix(colour, mix(FREE, tint, TINT / total.max(1.0).powi(3)), total);
    }
    if let Some((walls, total)) = weighted_mean(with_colours(|share| share.wall)) {
        let strongest = shares.iter().map(|share| share.wall).fold(0.0, f64::max);
        let common = total - strongest;
        colour = mix(colour, mix(walls, OCCUPIED, SHADOW * common.min(1.0)), strongest);
    }
    colour
}

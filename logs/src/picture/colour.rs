//! The colours of a picture.

use super::image::Rgb;
use super::layer::Coverage;

pub(super) const UNKNOWN: Rgb = Rgb([205, 205, 205]);
pub(super) const FREE: Rgb = Rgb([255, 255, 255]);
pub(super) const OCCUPIED: Rgb = Rgb([0, 0, 0]);
/// What lies behind the maps of an overlay: lighter, so that the tints stand out.
const BACKGROUND: Rgb = Rgb([218, 218, 218]);

/// Colours that people with any kind of colour vision can tell apart (Okabe and Ito, 2008), those that are dark enough
/// for lines on white first.
const PALETTE: [Rgb; 6] = [
    Rgb([0, 114, 178]),
    Rgb([213, 94, 0]),
    Rgb([0, 158, 115]),
    Rgb([204, 121, 167]),
    Rgb([230, 159, 0]),
    Rgb([86, 180, 233]),
];
/// How much of a map's colour its free space has.
const TINT: f64 = 0.2;
/// How much darker walls are that two maps have in common.
const SHADOW: f64 = 0.45;

/// The colour (red, green, blue) of the map at a place in the list; after six they start again.
pub fn robot_colour(index: usize) -> [u8; 3] {
    PALETTE[index % PALETTE.len()].0
}

/// `share`, 0 to 1, of the way from one colour to another.
pub(super) fn mix(from: Rgb, to: Rgb, share: f64) -> Rgb {
    let share = share.clamp(0.0, 1.0);
    Rgb(std::array::from_fn(|i| (f64::from(from.0[i]) * (1.0 - share) + f64::from(to.0[i]) * share).round() as u8))
}

/// The mean of the maps' colours, each with its weight, and the sum of the weights.
fn weighted_mean(weights: impl Iterator<Item = f64>) -> Option<(Rgb, f64)> {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (index, weight) in weights.enumerate() {
        let colour = robot_colour(index);
        sum.iter_mut().zip(colour).for_each(|(sum, channel)| *sum += weight * f64::from(channel));
        total += weight;
    }
    (total > 0.0).then(|| (Rgb(sum.map(|channel| (channel / total).round() as u8)), total))
}

/// The colour of a pixel of an overlay.
pub(super) fn overlay(shares: &[Coverage]) -> Rgb {
    let mut colour = BACKGROUND;
    if let Some((tint, total)) = weighted_mean(shares.iter().map(|share| share.free)) {
        // What one map knows has its colour; what several know is nearly white, so that the overlap shows.
        colour = mix(colour, mix(FREE, tint, TINT / total.max(1.0).powi(3)), total);
    }
    if let Some((walls, total)) = weighted_mean(shares.iter().map(|share| share.wall)) {
        let strongest = shares.iter().map(|share| share.wall).fold(0.0, f64::max);
        let common = total - strongest;
        colour = mix(colour, mix(walls, OCCUPIED, SHADOW * common.min(1.0)), strongest);
    }
    colour
}

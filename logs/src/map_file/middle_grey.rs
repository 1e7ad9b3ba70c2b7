//! The grey of unknown cells in the images that Cartographer writes: 128, half of white, or 127 where it is inverted or
//! was rounded down.

/// The shades of half of white.
const MIDDLE: [usize; 2] = [127, 128];
/// How much rarer the shades beside it are: cells that were seen once have shades near it.
const LEAST_PEAK: u64 = 4;
/// The distance from it beyond which a shade is that of walls or of free space.
const LEAST_CONTRAST: usize = 26;

/// The shade of unknown cells in the middle of a histogram; `None` if there is none. It is a peak, and at least as frequent
/// as walls are, which are darker; something must be lighter.
pub(super) fn unknown_middle(greys: &[u64; 256]) -> Option<usize> {
    let shade = MIDDLE.into_iter().max_by_key(|shade| greys[*shade])?;
    let count = greys[shade];
    let darker: u64 = greys[..shade - LEAST_CONTRAST].iter().sum();
    let lighter: u64 = greys[shade + LEAST_CONTRAST..].iter().sum();
    let is_peak = [shade - 1, shade + 1].iter().all(|beside| LEAST_PEAK * greys[*beside] < count);
    (is_peak && darker > 0 && lighter > 0 && count >= darker).then_some(shade)
}

//! Aligns maps by their Hough spectra: Carpin, "Fast and accurate map merging for multi-robot systems", Autonomous
//! Robots 25 (2008).
//!
//! The spectrum of a map is the amount of wall along each direction, at any position; so the cross-correlation of two
//! spectra gives the rotation without the translation, up to half a turn. The translation then comes one axis at a
//! time from the cross-correlation of the maps' projections. There is no exhaustive search, which makes it the
//! fastest way to align maps without an initial guess.
//!
//! - [`WallCells`]: the occupied cells of a map.
//! - [`HoughSpectrum`]: `HS(theta)`, and [`rotations`]: the peaks of the circular cross-correlation of two of them.
//! - [`Projection`]: the X and the Y spectrum, and [`shifts`]: the peaks of the cross-correlation of two of them.
//! - [`align_spectra`]: all of it. Each pose gets its acceptance index.
//!
//! Not in the paper: peaks are interpolated between steps; the projections are along the main direction of map a's
//! walls; and every pose has a covariance, from the half widths of its three peaks. It is the sharpness of these, and
//! no measure of whether the pose is right.
//!
//! There is no verification but the acceptance index: the method merges wrongly where maps agree at a wrong pose, as
//! in buildings with similar rooms, and where two robots share little, their projections are mostly of what they do
//! not share. Where walls have many directions or none, the spectra are flat, and the rotation is arbitrary.

mod align;
mod parameters;
mod peak;
mod rotation;
mod spectrum;
#[cfg(test)]
mod tests;
mod translation;
mod wall_cells;

pub use align::align_spectra;
pub use parameters::HoughSpectrumParameters;
pub use rotation::{Rotation, correlate_spectra, rotations};
pub use spectrum::HoughSpectrum;
pub use translation::{Projection, Shift, project, shifts};
pub use wall_cells::WallCells;

use crate::pair_aligner::{Criterion, Method, PairAligner, RatedPose};
use gridweave_runtime::stage::StageKind;
use gridweave_stages::registration::search::{NamedMap, SearchRefusal};

/// The stage kind `hough_spectrum_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "hough_spectrum_aligner",
        "Aligns the maps of each pair of robots by their Hough spectra, after Carpin (2008): the cross-correlation of \
         the spectra gives the rotation, that of the projections on two axes the translation. The pose with the best acceptance \
         index omega is taken if that is high enough; nothing else is checked, so maps that agree at a wrong pose are \
         merged wrongly.",
        |parameters: HoughSpectrumParameters, _| Ok(PairAligner::new(parameters)),
    )
    .input("map", "The robots' maps.", PairAligner::receive_map)
    .finish(PairAligner::finish)
    .build()
}

impl Method for HoughSpectrumParameters {
    const NAME: &'static str = "hough_spectrum";

    fn align(&self, a: &NamedMap<'_>, b: &NamedMap<'_>) -> Result<Vec<RatedPose>, SearchRefusal> {
        align_spectra(a, b, self)
    }

    fn criterion(&self) -> Criterion {
        Criterion { min_omega: self.min_omega, min_overlap: self.min_overlap }
    }

    fn max_hypotheses(&self) -> usize {
        self.max_hypotheses
    }
}

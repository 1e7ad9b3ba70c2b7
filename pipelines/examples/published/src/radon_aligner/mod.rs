//! Estimates the relative pose of two maps by the directions of their walls: the rotation from the Radon transforms
//! of both maps, the translation from their projections.
//!
//! The first step of the map merger of Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a topological approach to
//! map merging for multiple robots" (IEEE Robotics and Automation Magazine, June 2014), section "Uncertain Rotation
//! Alignment" and equation 8. In an occupancy grid of a built place the energy of the Radon transform over its angle
//! has a peak at each direction of walls, and comes again after a quarter turn. So the two maps' energies determine the
//! rotation up to quarter turns; of the four hypotheses one is taken by a similarity index.
//!
//! What the paper leaves open, and how it is decided here:
//! - **What is transformed**: the occupied cells, each counting 1. Free space has no direction of its own, and
//!   a probability as weight would let the robot that has looked longer decide.
//! - **Energy**: the sum of the squared projection over all distances, as in the Hough spectrum (Carpin 2008); the
//!   energies at an angle and at the one across it are added, which makes use of all walls for one peak.
//! - **Rotation**: the peak of the circular correlation of both energies. A single highest peak in each map would be as
//!   good in a hall, but of two wings at an angle the maps need not agree on which is the longer.
//! - **Variance of the rotation**: its standard deviation is a tenth of that of the Gaussian as wide as the
//!   correlation's peak at half its height, see [`RotationPeak`]. The width itself is 1 to 7 degrees in real maps,
//!   whose rotations come out to 0.5 degrees and better.
//! - **Similarity index**: the acceptance index of Birk and Carpin, the share of the cells known to both maps on which
//!   they agree. It needs a translation: for each of the four rotations the maps' projections on the axes of the walls
//!   are correlated, all combinations of the best shifts of both axes are tried, and the index is taken where it is
//!   greatest. A place at which the maps share little does not count, as the index is a share of whatever they have in
//!   common.
//!
//! The method has no verification: free space agrees with free space at any pose of two buildings, so unrelated maps
//! pass, too, and similar rooms are confused. For comparison, and as the first step of
//! `pipelines/group_mapping.toml`; where a merge matters, use `map_aligner` and `merge_verifier`.
//!
//! - [`WallPoints`], [`energy`]: the Radon transform's energy over half a turn.
//! - [`QuarterEnergy`], [`RotationPeak`]: the correlation of two energies.
//! - [`Profile`]: projections, and the shifts at which they fit.
//! - [`align`]: all of it.

mod align;
mod parameters;
mod peak_shape;
mod profile;
mod quarter_energy;
mod radon;
mod refusal;
mod stage;
#[cfg(test)]
mod tests;

pub use align::{NamedMap, PreparedMap, RadonAlignment, align};
pub use parameters::RadonAlignerParameters;
pub use profile::{Profile, Shift};
pub use quarter_energy::{QuarterEnergy, RotationPeak};
pub use radon::{WallPoints, energy};
pub use refusal::RadonRefusal;

use gridweave_runtime::stage::StageKind;
use stage::RadonAligner;

/// The stage kind `radon_aligner`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "radon_aligner",
        "Estimates the relative pose of the maps of each pair of robots by the directions of their walls: the energies of their Radon \
         transforms give the rotation up to quarter turns, projections on the walls' axes the translation, and of the four \
         rotations the one is taken at which the maps agree best where they overlap (Saeedi et al., \"Group mapping\"). The \
         rotation's variance comes from the width of the peak. Nothing is verified: unrelated maps can pass.",
        |parameters: RadonAlignerParameters, _| Ok(RadonAligner::new(parameters)),
    )
    .input("map", "The robots' maps.", RadonAligner::receive_map)
    .build()
}

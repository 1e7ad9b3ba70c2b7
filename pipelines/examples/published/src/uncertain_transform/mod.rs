//! Transforms maps into the world by uncertain transforms: the uncertainty of a map's pose becomes blur of its cells.
//!
//! Algorithm 1 ("Linearized uncertainty propagation") of Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a
//! topological approach to map merging for multiple robots" (IEEE Robotics and Automation Magazine, June 2014). A
//! point `m` of a map is transformed to `n = R m + t`, with the covariance `S_n = J S_tr J^T`, where `S_tr` is that
//! of the transform and J the derivative of n with respect to (x, y, psi) (equation 4 of the paper); the transformed
//! map, in log-odds (equation 7), is convolved there with the Gaussian `N(n, S_n)` (equation 6). The rotation's part
//! of S_n grows with the distance from the origin of the map's frame, so the blur is small where the two maps are
//! connected and grows away from there.
//!
//! What the paper leaves open, and how it is decided here:
//! - **The transformed map** is looked up cell by cell as in `grid_fuser`, since carrying cells forward and rounding
//!   leaves gaps (step 1 of the algorithm).
//! - **The kernel's size**: the paper takes one as large as the map. It is cut at three standard deviations, on the
//!   ellipse, and normalised to 1 over what is left: a cell keeps 98.9 % of its blur and costs some hundred
//!   multiplications instead of a million. [`convolve_exactly`] is the form without the cut, for tests.
//! - **Kernels per tile**: all cells of a tile of [`TILE`] x [`TILE`] take the kernel of its middle. S_n changes from
//!   one edge of a tile to the other by the turn of as many cells, which is far below the width of a kernel.
//! - **Wide kernels on coarse cells**: where a place is uncertain by four cells and more in every direction, the kernel
//!   is applied to means of 2 x 2 cells, and narrowed by what these means blur. Nothing so blurred has any detail of the
//!   size of a cell.
//! - **A cell's own width**: the variance of a place in a square cell is added to S_n. It makes every S_n invertible,
//!   that of the reference robot among them, whose map is not blurred by it.
//! - **Unknown cells** have log-odds of 0, as in the paper. A wall may so reach into what its robot has not seen, as
//!   far as the wall may lie there. Such a cell stays unknown where less than half a percent is left of what it would
//!   say.
//! - **Bounds**: a point less certain than `max_deviation` is blurred with that deviation, since the cost grows with
//!   the square of the blur, and its evidence is negligible in any case.
//!
//! - [`PointCovariance`]: S_n at any place.
//! - [`Kernel`]: the Gaussian on cells, cut.
//! - [`convolve`], [`convolve_exactly`]: step 6 of the algorithm.
//! - [`transform`]: the whole algorithm.

mod convolve;
mod kernel;
mod padded_field;
mod parameters;
mod point_covariance;
mod stage;
#[cfg(test)]
mod tests;
mod transform;

pub use convolve::{TILE, convolve, convolve_exactly};
pub use kernel::Kernel;
pub use parameters::UncertainTransformParameters;
pub use point_covariance::PointCovariance;
pub use transform::{NotTransformed, Transformed, transform};

use gridweave_runtime::stage::StageKind;
use stage::UncertainTransform;

/// The stage kind `uncertain_transform`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "uncertain_transform",
        "Transforms the map of every placed robot into the world, and blurs it by the covariance of its frame: algorithm 1 of \
         Saeedi et al., \"Group mapping\". All maps are sent on the cells of one lattice, that of the reference robot's map, so \
         that they can be fused cell by cell.",
        |parameters: UncertainTransformParameters, _| Ok(UncertainTransform::new(parameters)),
    )
    .input("map", "The robots' maps.", UncertainTransform::receive_map)
    .input("frames", "The poses of the maps, with covariances.", UncertainTransform::receive_frames)
    .build()
}

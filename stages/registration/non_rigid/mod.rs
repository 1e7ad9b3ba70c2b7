//! Non-rigid registration: deforms placed maps, so that walls that several of them have are aligned. The maps of a
//! SLAM are right in every room and deformed as a whole.
//!
//! Each map gets a lattice of nodes ([`Deformation`](crate::shared::deformation::Deformation)). All nodes of all maps
//! are estimated together, as the least squares of
//!
//! - walls: a point of a wall of one map is on the same face of a wall of another, measured across that wall, with a
//!   Geman-McClure kernel that narrows from round to round (graduated non-convexity, Yang et al. 2020);
//! - drift: neighbouring nodes of a map are displaced and turned alike, as far as the drift of a SLAM allows, a
//!   random walk: the variance grows with the distance. Where only one map is known, this extrapolates the deformation,
//!   and the map is locally rigid;
//! - frames: a wide prior keeps the maps near their rigid frames.
//!
//! Where most maps were deformed before, the new ones are first aligned with these as they are, and the last rounds
//! estimate all together. Maps that are held stay as they were deformed, and only the others are estimated.
//!
//! Maps stay rigid where that is likelier than a deformation: where the noise of cells explains the walls as well.
//!
//! Nodes that are rigid pieces connected by drift are the submaps of Atlas (Bosse et al. 2004) and Cartographer (Hess
//! et al. 2016), on a lattice as in Kimera-Multi's deformation graphs (Tian et al. 2022) and in the embedded
//! deformation (Sumner et al. 2007). The alignment of all walls at once, and not region by region, is the
//! optimisation of Shahbandi, Magnusson and Iagnemma (2018), with points and lines in place of a distance map's
//! gradient.

mod anchor;
mod body;
mod contacts;
mod drift;
mod equations;
mod evidence;
mod parameters;
mod refine;
mod rounds;
mod sharpness;
#[cfg(test)]
mod tests;

pub use anchor::anchor;
pub use body::{Body, Shape};
pub use drift::Drift;
pub use parameters::DeformationParameters;
pub use refine::{RefinedMap, Refinement, deform_onto, refine};
pub use sharpness::sharpness;

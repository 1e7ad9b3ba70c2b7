//! Grid fuser: the maps of all placed robots in, one map out (Tsardoulias et al., section 4.4), and where they
//! contradict each other.
//!
//! Every robot's map is carried into the world, which is the reference robot's map frame, through its bend if one is known,
//! and the maps are added in log-odds. Coverage fields, which are grids too, can be fused by a second stage of this kind.
//!
//! - [`known`]: where the known cells of a map lie, so that nothing else is walked.
//! - [`layout`]: how large the fused grid is, and where its cells lie.
//! - [`evidence`]: cell values as log-odds, their sum, and how far they contradict each other.
//! - [`agreement`]: how much is known to one map and to several, and how much of it is in conflict.
//! - [`inverse`]: every output cell looked up in the maps; the default.
//! - [`forward`]: every map cell carried to the output and rounded, gaps closed by a conditional mean; the paper's way.

pub mod agreement;
pub mod evidence;
pub mod forward;
pub mod inverse;
pub mod known;
pub mod layout;
mod parameters;
mod stage;
#[cfg(test)]
mod tests;

pub use known::KnownArea;
pub use parameters::{GridFuserParameters, Warp};
pub use stage::kind;

use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, Point2, Pose2};

/// A map and where it lies.
#[derive(Clone, Copy, Debug)]
pub struct PlacedGrid<'a> {
    /// The map.
    pub grid: Grid<'a>,
    /// `T_world_map`: the pose of the map frame in the world.
    pub transform_world_map: Pose2,
    /// How the map is bent; none if it is rigid.
    pub deformation: Option<&'a Deformation>,
}

/// What is made of the maps: two grids of the same size.
#[derive(Debug)]
pub struct Fused<'a> {
    /// The fused map: -1 unknown, 0 free to 100 occupied.
    pub cells: &'a mut [i8],
    /// How far the maps contradict each other: see [`EvidenceTable::conflict`](evidence::EvidenceTable::conflict).
    pub conflicts: &'a mut [i8],
}

impl<'a> PlacedGrid<'a> {
    /// A map that is not bent.
    pub fn rigid(grid: Grid<'a>, transform_world_map: Pose2) -> Self {
        Self { grid, transform_world_map, deformation: None }
    }

    /// Where a point of the map lies in the world, given in cells along the grid's sides from its corner.
    pub fn in_world(&self, cells: &Point2) -> Point2 {
        let in_grid = cells * self.grid.geometry.resolution;
        match self.deformation {
            None => self.transform_world_grid() * in_grid,
            Some(deformation) => self.transform_world_map * deformation.apply(&(self.grid.geometry.origin * in_grid)),
        }
    }

    /// `T_world_grid`: the pose of the grid's corner in the world.
    pub fn transform_world_grid(&self) -> Pose2 {
        self.transform_world_map * self.grid.geometry.origin
    }
}

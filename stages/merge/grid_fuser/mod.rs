//! Grid fuser: fuses the maps of all placed robots to one (Tsardoulias et al., section 4.4), and shows where they
//! contradict each other.
//!
//! Every robot's map is transformed into the world, which is the reference robot's map frame, by its deformation if
//! one is known, and the maps are added in log-odds. Coverage fields, which are grids too, can be fused by a second
//! stage of this kind.
//!
//! - [`known`]: the known cells of a map, so that nothing else is visited.
//! - [`layout`]: size and origin of the fused grid.
//! - [`evidence`]: cell values as log-odds, their sum, and their conflict.
//! - [`agreement`]: areas that one map and several know, and that are in conflict.
//! - [`inverse`]: every output cell looked up in the maps; the default.
//! - [`forward`]: every map cell transformed to the output and rounded, gaps closed by a conditional mean; as in the
//!   paper.

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

/// A map with its pose and deformation.
#[derive(Clone, Copy, Debug)]
pub struct PlacedGrid<'a> {
    /// The map.
    pub grid: Grid<'a>,
    /// `T_world_map`: the pose of the map frame in the world.
    pub transform_world_map: Pose2,
    /// Deformation of the map; none if it is rigid.
    pub deformation: Option<&'a Deformation>,
}

/// Output of the fusion: two grids of the same size.
#[derive(Debug)]
pub struct Fused<'a> {
    /// The fused map: -1 unknown, 0 free to 100 occupied.
    pub cells: &'a mut [i8],
    /// Conflict of the maps: see [`EvidenceTable::conflict`](evidence::EvidenceTable::conflict).
    pub conflicts: &'a mut [i8],
}

impl<'a> PlacedGrid<'a> {
    /// A map without deformation.
    pub fn rigid(grid: Grid<'a>, transform_world_map: Pose2) -> Self {
        Self { grid, transform_world_map, deformation: None }
    }

    /// Position in the world of a point of the map, given in cells along the grid's sides from its corner.
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

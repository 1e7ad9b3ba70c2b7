//! Draws each placed robot's map where it lies in the merged one: through its bend and its frame, alone.
//!
//! What the [grid fuser](crate::merge::grid_fuser) adds up, robot by robot, for those who want to see who saw what: pictures, and
//! layers in a viewer. Nothing of it is in any other result.

mod stage;

pub use stage::kind;

use crate::merge::grid_fuser::evidence::EvidenceTable;
use crate::merge::grid_fuser::layout::{Lattice, lay_out};
use crate::merge::grid_fuser::{Fused, GridFuserParameters, KnownArea, PlacedGrid, inverse};
use crate::shared::geometry::{Grid, GridGeometry};
use crate::shared::placement::Placed;

/// A map, where it lies in the world, and the cells that it takes there.
#[derive(Debug)]
pub struct PlacedMap<'a> {
    map: (PlacedGrid<'a>, &'a KnownArea),
    geometry: GridGeometry,
}

impl<'a> PlacedMap<'a> {
    /// Lays a map on cells of its own size along the axes of the world. None if nothing of it is known, or if it lies too far
    /// away for numbers.
    pub fn new(grid: Grid<'a>, area: &'a KnownArea, placed: &Placed<'a>) -> Option<Self> {
        let Placed { transform_world_map, deformation } = *placed;
        let map = (PlacedGrid { grid, transform_world_map, deformation }, area);
        let GridFuserParameters { max_extent, max_cells, .. } = Default::default();
        let anchor = map.0.transform_world_grid().translation.vector.into();
        let lattice = Lattice { anchor, resolution: grid.geometry.resolution, max_extent, max_cells };
        Some(Self { map, geometry: lay_out(&[map], &lattice).geometry? })
    }

    /// Where its cells lie in the world.
    pub fn geometry(&self) -> &GridGeometry {
        &self.geometry
    }

    /// Writes its cells.
    pub fn draw(&self, cells: &mut [i8]) {
        let GridFuserParameters { min_probability, max_probability, .. } = Default::default();
        let table = EvidenceTable::new(min_probability, max_probability);
        // Nothing contradicts a map that is alone.
        let mut conflicts = vec![0; self.geometry.cell_count()];
        inverse::fuse(&[self.map], &self.geometry, &table, Fused { cells, conflicts: &mut conflicts });
    }
}

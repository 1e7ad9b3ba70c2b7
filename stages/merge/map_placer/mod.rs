//! Transforms each placed robot's map into the merged frame, by its deformation and its frame.
//!
//! These are the maps that the [grid fuser](crate::merge::grid_fuser) adds up, one for each robot, for pictures and
//! for layers in a viewer. No other result depends on them.

mod stage;

pub use stage::kind;

use crate::merge::grid_fuser::evidence::EvidenceTable;
use crate::merge::grid_fuser::layout::{CellLattice, layout_of};
use crate::merge::grid_fuser::{Fused, GridFuserParameters, KnownArea, PlacedGrid, inverse};
use crate::shared::geometry::{Grid, GridGeometry};
use crate::shared::placement::Placed;

/// A map with its pose in the world, and the grid that it covers there.
#[derive(Debug)]
pub struct PlacedMap<'a> {
    map: (PlacedGrid<'a>, &'a KnownArea),
    geometry: GridGeometry,
}

impl<'a> PlacedMap<'a> {
    /// Transforms a map to cells of its own size along the axes of the world. None if nothing of it is known, or if
    /// it is too far away.
    pub fn new(grid: Grid<'a>, area: &'a KnownArea, placed: &Placed<'a>) -> Option<Self> {
        let Placed { transform_world_map, deformation } = *placed;
        let map = (PlacedGrid { grid, transform_world_map, deformation }, area);
        let GridFuserParameters { max_extent, max_cells, .. } = Default::default();
        let anchor = map.0.transform_world_grid().translation.vector.into();
        let lattice = CellLattice { anchor, resolution: grid.geometry.resolution, max_extent, max_cells };
        Some(Self { map, geometry: layout_of(&[map], &lattice).geometry? })
    }

    /// Its grid in the world.
    pub fn geometry(&self) -> &GridGeometry {
        &self.geometry
    }

    /// Writes its cells.
    pub fn draw(&self, cells: &mut [i8]) {
        let GridFuserParameters { min_probability, max_probability, .. } = Default::default();
        let table = EvidenceTable::new(min_probability, max_probability);
        // A single map is in no conflict.
        let mut conflicts = vec![0; self.geometry.cell_count()];
        inverse::fuse(&[self.map], &self.geometry, &table, Fused { cells, conflicts: &mut conflicts });
    }
}

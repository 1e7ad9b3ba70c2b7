//! Algorithm 1: transforms a map into the world and blurs it there.

use super::{Kernel, PointCovariance, UncertainTransformParameters, convolve};
use crate::log_odds::LogOdds;
use gridweave_stages::merge::grid_fuser::evidence::EvidenceTable;
use gridweave_stages::merge::grid_fuser::layout::{CellLattice, LeftOut, layout_of};
use gridweave_stages::merge::grid_fuser::{Fused, KnownArea, PlacedGrid, inverse};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Point2, UNKNOWN, pose};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// A map in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Transformed {
    /// Geometry of its cells, along the axes of the world.
    pub geometry: GridGeometry,
    /// Row by row: -1 unknown, 0 free to 100 occupied.
    pub cells: Vec<i8>,
}

/// Why a map is not transformed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NotTransformed {
    /// The covariance of its frame is invalid.
    #[error("the covariance of its frame is invalid: a value is not finite, or a variance is below 0")]
    Covariance,
    /// Its grid is invalid.
    #[error(transparent)]
    LeftOut(#[from] LeftOut),
}

/// Transforms a map into the world by a transform with a covariance of (x, y, yaw), onto the cells of a lattice.
/// `None` if nothing of it is known.
///
/// # Errors
/// The covariance is invalid, or the map would have too many cells.
pub fn transform(
    map: &PlacedGrid<'_>,
    area: &KnownArea,
    covariance: &Matrix3<f64>,
    lattice: &CellLattice,
    parameters: &UncertainTransformParameters,
) -> Result<Option<Transformed>, NotTransformed> {
    let resolution = lattice.resolution;
    let covariance = PointCovariance::new(&map.transform_world_map, covariance, resolution, parameters.max_deviation)
        .ok_or(NotTransformed::Covariance)?;
    let layout = layout_of(&[(*map, area)], lattice);
    layout.takes_part.into_iter().collect::<Result<(), LeftOut>>()?;
    let Some(sharp) = layout.geometry else { return Ok(None) };

    // Step 1: the transformed map. What is blurred reaches beyond it.
    let margin = Kernel::reach(covariance.greatest_deviation(&corners(&sharp)) / resolution);
    let geometry = widened(&sharp, margin);
    if geometry.cell_count() as f64 > lattice.max_cells as f64 {
        return Err(LeftOut::TooManyCells(lattice.max_cells).into());
    }
    let mut cells = vec![UNKNOWN; geometry.cell_count()];
    let mut conflicts = vec![UNKNOWN; geometry.cell_count()];
    let table = EvidenceTable::new(parameters.min_probability, parameters.max_probability);
    inverse::fuse(&[(*map, area)], &geometry, &table, Fused { cells: &mut cells, conflicts: &mut conflicts });
    drop(conflicts);

    // Steps 3 to 7, in log-odds.
    let table = LogOdds::new(parameters.min_probability, parameters.max_probability);
    let log_odds: Vec<f32> = cells.par_iter().with_min_len(1 << 14).map(|value| table.of(*value)).collect();
    let mut blurred = vec![0.0; log_odds.len()];
    convolve(&log_odds, &geometry, &covariance, &mut blurred);
    let nothing = table.value(0.0);
    let write = |(cell, log_odds): (&mut i8, &f32)| {
        let value = table.value(*log_odds);
        if *cell != UNKNOWN || value != nothing {
            *cell = value;
        }
    };
    cells.par_iter_mut().with_min_len(1 << 14).zip(&blurred).for_each(write);
    Ok(Some(Transformed { geometry, cells }))
}

/// The outer corners of a grid.
fn corners(geometry: &GridGeometry) -> [Point2; 4] {
    let (x, y) = (geometry.width as f64 * geometry.resolution, geometry.height as f64 * geometry.resolution);
    [(0.0, 0.0), (x, 0.0), (0.0, y), (x, y)].map(|(x, y)| geometry.origin * Point2::new(x, y))
}

/// A grid with more cells on all sides.
fn widened(geometry: &GridGeometry, cells: usize) -> GridGeometry {
    let back = -(cells as f64) * geometry.resolution;
    GridGeometry {
        width: geometry.width + 2 * cells,
        height: geometry.height + 2 * cells,
        resolution: geometry.resolution,
        origin: geometry.origin * pose(back, back, 0.0),
    }
}

impl Transformed {
    /// The map as a grid.
    pub fn grid(&self) -> Grid<'_> {
        Grid { geometry: self.geometry, cells: &self.cells }
    }
}

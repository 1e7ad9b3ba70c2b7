//! A map as the search takes it.

use super::{Raster, SearchRefusal, Walls};
use crate::shared::geometry::Grid;

/// Rasters of a map, each in cells twice as wide as the one before.
const LEVELS: usize = 6;

/// The level in whose cells places are judged.
pub(crate) const JUDGED: usize = 1;

/// A cell of a raster is at least as many cells of the grid wide: then, however the grid is turned, none in its midst is
/// left out.
const LEAST_CELLS: f64 = 1.5;

/// As many points stand for all walls where a place is judged, and on the way to it.
const POINTS: usize = 1200;
const FEW_POINTS: usize = 400;

/// A map in cells of several sizes, and its walls.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedMap {
    levels: Vec<Raster>,
    walls: Walls,
    few_walls: Walls,
}

impl PreparedMap {
    /// The least cells in which a grid can be prepared, metres.
    pub fn least_cell(grid: &Grid<'_>) -> f64 {
        LEAST_CELLS * grid.geometry.resolution
    }

    /// The map of `robot`, its finest raster in cells of `cell` metres.
    pub fn new(robot: &str, grid: &Grid<'_>, cell: f64, max_extent: f64) -> Result<Self, SearchRefusal> {
        let raster = Raster::new(grid, cell.max(Self::least_cell(grid)), max_extent)
            .ok_or_else(|| SearchRefusal::TooLarge { robot: robot.to_owned(), most: max_extent })?;
        let map = Self::of_raster(raster);
        if map.walls.is_empty() { Err(SearchRefusal::NoWalls { robot: robot.to_owned() }) } else { Ok(map) }
    }

    /// A map of which there is a raster.
    pub fn of_raster(finest: Raster) -> Self {
        let (walls, few_walls) = (Walls::new(&finest, POINTS), Walls::new(&finest, FEW_POINTS));
        let mut levels = vec![finest];
        while let (Some(last), true) = (levels.last(), levels.len() < LEVELS) {
            levels.push(last.halved());
        }
        Self { levels, walls, few_walls }
    }

    /// The raster whose cells are `2 ^ number` times as wide as those of the finest, or the widest that there is.
    pub fn level(&self, number: usize) -> &Raster {
        &self.levels[number.min(LEVELS - 1)]
    }

    /// The number of the level whose cells are the least with which the map is at most `most` cells long.
    pub(super) fn level_of_size(&self, most: usize) -> usize {
        let is_small = |raster: &Raster| raster.width.max(raster.height) <= most;
        self.levels.iter().position(is_small).unwrap_or(LEVELS - 1)
    }

    /// Its walls.
    pub fn walls(&self) -> &Walls {
        &self.walls
    }

    /// Its walls by fewer points, which take less time.
    pub fn few_walls(&self) -> &Walls {
        &self.few_walls
    }
}

//! A map prepared for the search.

use super::{Raster, SearchRefusal, Walls};
use crate::shared::geometry::{Grid, is_free};

/// Number of rasters of a map, each in cells twice as wide as the one before.
const LEVELS: usize = 6;

/// Level in whose cells poses are scored.
pub(crate) const JUDGED: usize = 1;

/// Least width of a cell of a raster in cells of the grid, so that none in its middle is left out, however the grid
/// is turned.
const LEAST_CELLS: f64 = 1.5;

/// Number of points on walls where a pose is scored, and in the ascent.
const POINTS: u16 = 1200;
const FEW_POINTS: u16 = 400;

/// A map in cells of several sizes, and its walls.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedMap {
    levels: Vec<Raster>,
    walls: Walls,
    few_walls: Walls,
}

impl PreparedMap {
    /// Least cell size in which a grid can be prepared, metres.
    pub fn least_cell(grid: &Grid<'_>) -> f64 {
        LEAST_CELLS * grid.geometry.resolution
    }

    /// The map of `robot`, its finest raster in cells of `cell` metres.
    pub fn new(robot: &str, grid: &Grid<'_>, cell: f64, max_extent: f64) -> Result<Self, SearchRefusal> {
        let raster = Raster::new(grid, cell.max(Self::least_cell(grid)), max_extent)
            .ok_or_else(|| SearchRefusal::TooLarge { robot: robot.to_owned(), most: max_extent })?;
        let map = Self::of_raster(raster);
        if map.walls.is_empty() {
            return Err(SearchRefusal::NoWalls { robot: robot.to_owned() });
        }
        // Walls are compared from the side on which they were seen, which is that of the free space.
        if !grid.cells.iter().any(|value| is_free(*value)) {
            return Err(SearchRefusal::NoFreeSpace { robot: robot.to_owned() });
        }
        Ok(map)
    }

    /// A map from its finest raster.
    pub fn of_raster(finest: Raster) -> Self {
        let (walls, few_walls) = (Walls::new(&finest, POINTS), Walls::new(&finest, FEW_POINTS));
        let mut levels = vec![finest];
        while let (Some(last), true) = (levels.last(), levels.len() < LEVELS) {
            levels.push(last.halved());
        }
        Self { levels, walls, few_walls }
    }

    /// Its mirror image.
    pub(super) fn mirrored(&self) -> Self {
        Self::of_raster(self.levels[0].mirrored())
    }

    /// The raster whose cells are `2 ^ number` times as wide as those of the finest, or the widest one.
    pub fn level(&self, number: usize) -> &Raster {
        &self.levels[number.min(LEVELS - 1)]
    }

    /// Index of the level with the least cells in which the map is at most `most` cells long.
    pub(super) fn level_of_size(&self, most: usize) -> usize {
        let is_small = |raster: &Raster| raster.width.max(raster.height) <= most;
        self.levels.iter().position(is_small).unwrap_or(LEVELS - 1)
    }

    /// Half the diagonal of its bounding box, metres.
    pub(crate) fn radius(&self) -> f64 {
        let raster = self.level(JUDGED);
        0.5 * raster.cell * (raster.width as f64).hypot(raster.height as f64)
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

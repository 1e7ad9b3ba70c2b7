//! Occupancy grids: their geometry and their cells.

use super::{Point2, Pose2};
use gridweave_runtime::ros::cell::{UNKNOWN, is_occupied};
use gridweave_runtime::ros::{GridError, GridPrefix, Header, MapMetaData, OccupancyGrid, Time};

/// Number of cells that are tested together.
const BLOCK: usize = 64;

/// Indices of a cell in a grid: column (along x) and row (along y).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Along the grid's x axis, from 0.
    pub column: usize,
    /// Along the grid's y axis, from 0.
    pub row: usize,
}

/// Geometry of the cells of a grid in its map frame.
///
/// Cell (column, row) has its centre at `origin * ((column + 0.5) * resolution, (row + 0.5) * resolution)`. The origin
/// is a pose with yaw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridGeometry {
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Metres per cell.
    pub resolution: f64,
    /// `T_map_grid`: the pose of the outer corner of cell (0, 0) in the map frame.
    pub origin: Pose2,
}

impl GridGeometry {
    /// Centre of a cell in the map frame.
    pub fn centre(&self, cell: Cell) -> Point2 {
        let x = (cell.column as f64 + 0.5) * self.resolution;
        let y = (cell.row as f64 + 0.5) * self.resolution;
        self.origin * Point2::new(x, y)
    }

    /// The cell that contains a point of the map frame, if it is on the grid.
    pub fn cell(&self, point: &Point2) -> Option<Cell> {
        let local = self.origin.inverse_transform_point(point) / self.resolution;
        if !(local.x >= 0.0 && local.y >= 0.0) {
            return None;
        }
        let cell = Cell { column: local.x as usize, row: local.y as usize };
        (cell.column < self.width && cell.row < self.height).then_some(cell)
    }

    /// Index of a cell in the row-by-row list of cells.
    pub fn index(&self, cell: Cell) -> usize {
        cell.row * self.width + cell.column
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.width * self.height
    }

    /// Map meta data of a message for a grid that was loaded at a time. The sides must be less than 2^32.
    pub fn meta_data(&self, map_load_time: Time) -> MapMetaData {
        MapMetaData {
            map_load_time,
            resolution: self.resolution as f32,
            width: self.width as u32,
            height: self.height as u32,
            origin: self.origin.into(),
        }
    }

    /// A grid's message without its cells. The sides must be less than 2^32.
    pub fn prefix(&self, header: Header) -> GridPrefix {
        GridPrefix { info: self.meta_data(header.stamp), header }
    }
}

/// Largest number of cells of a grid that covers several maps with `known` known cells in all: memory is bounded by
/// the known area, and not by distances in messages. The bound is at least 200 x 200 m in cells of 0.05 m; beyond
/// that, connected maps know more than a sixty-fourth of their bounding rectangle.
pub fn most_cells_over(known: f64) -> f64 {
    (16 << 20) as f64 + 64.0 * known
}

/// An occupancy grid, its cells borrowed.
#[derive(Clone, Copy, Debug)]
pub struct Grid<'a> {
    /// Geometry of the cells.
    pub geometry: GridGeometry,
    /// Row by row: -1 unknown, 0 free to 100 occupied.
    pub cells: &'a [i8],
}

impl<'a> Grid<'a> {
    /// A grid of `cells`, of which there must be width x height. One without cells is 0 x 0, whatever its sides, as
    /// memory is allocated by the sides.
    pub fn new(mut geometry: GridGeometry, cells: &'a [i8]) -> Result<Self, GridError> {
        let GridGeometry { width, height, resolution, origin } = geometry;
        GridError::check(width, height, resolution, &origin, cells.len())?;
        if cells.is_empty() {
            (geometry.width, geometry.height) = (0, 0);
        }
        Ok(Self { geometry, cells })
    }

    /// The grid of a message.
    pub fn from_message(message: &OccupancyGrid<'a>) -> Result<Self, GridError> {
        Self::new(GridGeometry::from(&message.info), message.cells())
    }

    /// Value of a cell; unknown outside of the grid.
    pub fn value(&self, cell: Cell) -> i8 {
        match cell.column < self.geometry.width && cell.row < self.geometry.height {
            true => self.cells[self.geometry.index(cell)],
            false => UNKNOWN,
        }
    }

    /// Value of the cell that contains a point; unknown outside of the grid.
    pub fn value_at(&self, point: &Point2) -> i8 {
        self.geometry.cell(point).map_or(UNKNOWN, |cell| self.value(cell))
    }

    /// The occupied cells, row by row.
    pub fn occupied(&self) -> impl Iterator<Item = Cell> + 'a {
        // Most of a map is free or unknown. Whole blocks are skipped by their greatest value.
        let may_hold_one = |block: &[i8]| is_occupied(block.iter().fold(UNKNOWN, |most, v| most.max(*v)).min(100));
        let rows = self.cells.chunks(self.geometry.width.max(1)).enumerate();
        rows.flat_map(move |(row, cells)| {
            let blocks = cells.chunks(BLOCK).enumerate().filter(move |(_, block)| may_hold_one(block));
            blocks.flat_map(move |(number, block)| {
                let cells = block.iter().enumerate().filter(|(_, value)| is_occupied(**value));
                cells.map(move |(place, _)| Cell { column: number * BLOCK + place, row })
            })
        })
    }
}

impl From<&MapMetaData> for GridGeometry {
    fn from(info: &MapMetaData) -> Self {
        Self {
            width: info.width as usize,
            height: info.height as usize,
            // 0.05 as f32 is 0.05000000074505806; the intended decimal keeps maps from drifting by a cell over their
            // width.
            resolution: shortest_decimal(info.resolution),
            origin: info.origin.planar(),
        }
    }
}

/// The double with the shortest decimal that rounds to the given single.
fn shortest_decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or_else(|_| f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use proptest::prelude::*;

    fn geometry(x: f64, y: f64, yaw: f64) -> GridGeometry {
        GridGeometry { width: 30, height: 20, resolution: 0.05, origin: pose(x, y, yaw) }
    }

    proptest! {
        #[test]
        fn the_centre_of_a_cell_is_in_that_cell(
            x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0, column in 0usize..30, row in 0usize..20,
        ) {
            let geometry = geometry(x, y, yaw);
            let cell = Cell { column, row };
            prop_assert_eq!(geometry.cell(&geometry.centre(cell)), Some(cell));
        }
    }

    proptest! {
        #[test]
        fn the_occupied_cells_are_those_of_a_test_of_every_cell(
            width in 0usize..200, height in 0usize..5, values in prop::collection::vec(prop::num::i8::ANY, 1000),
        ) {
            // Most cells are free, so that there are blocks to skip.
            let cells: Vec<i8> =
                values.iter().enumerate().map(|(i, v)| if i % 7 == 0 { *v } else { 0 }).take(width * height).collect();
            let geometry = GridGeometry { width, height, ..geometry(0.0, 0.0, 0.0) };
            let grid = Grid::new(geometry, &cells).unwrap();
            let all = (0..cells.len()).filter(|&index| is_occupied(cells[index]));
            let expected: Vec<Cell> = all.map(|index| Cell { column: index % width, row: index / width }).collect();
            prop_assert_eq!(grid.occupied().collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn points_off_the_grid_have_no_cell() {
        let geometry = geometry(0.0, 0.0, 0.0);
        for (x, y) in [(-0.01, 0.5), (0.5, -0.01), (1.5, 0.5), (0.5, 1.0), (f64::NAN, 0.5), (f64::INFINITY, 0.5)] {
            assert_eq!(geometry.cell(&Point2::new(x, y)), None, "({x}, {y})");
        }
    }

    #[test]
    fn an_invalid_grid_is_refused() {
        let good = geometry(0.0, 0.0, 0.0);
        assert!(Grid::new(good, &[0; 600]).is_ok());
        assert!(matches!(Grid::new(good, &[0; 599]), Err(GridError::CellCount { actual: 599, .. })));
        for resolution in [0.0, -0.05, f64::NAN, f64::INFINITY] {
            let geometry = GridGeometry { resolution, ..good };
            assert!(matches!(Grid::new(geometry, &[0; 600]), Err(GridError::Resolution(_))));
        }
        let long = GridGeometry { width: 0, height: u32::MAX as usize, ..good };
        assert_eq!(Grid::new(long, &[]).unwrap().geometry, GridGeometry { width: 0, height: 0, ..good });
        let geometry = GridGeometry { origin: pose(f64::NAN, 0.0, 0.0), ..good };
        assert_eq!(Grid::new(geometry, &[0; 600]).unwrap_err(), GridError::Origin);
    }

    #[test]
    fn the_resolution_is_the_intended_decimal() {
        let info = MapMetaData { resolution: 0.05, ..Default::default() };
        assert_eq!(GridGeometry::from(&info).resolution, 0.05);
    }
}

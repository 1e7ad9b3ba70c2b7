//! The occupied cells of a map as points.

use gridweave_stages::registration::search::{NamedMap, SearchRefusal};
use gridweave_stages::shared::geometry::{Cell, Grid, Point2};

/// The centres of the occupied cells of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct WallCells {
    /// The middle of the rectangle that they fill, map frame, metres.
    pub middle: Point2,
    /// The farthest of them from the middle, metres.
    pub radius: f64,
    /// Coordinates about the middle, along the axes of the map frame, metres.
    pub points: Vec<[f32; 2]>,
}

impl WallCells {
    /// Those of a map.
    ///
    /// # Errors
    /// There are none, or they are spread over more than `max_extent` metres.
    pub fn new(map: &NamedMap<'_>, max_extent: f64) -> Result<Self, SearchRefusal> {
        let robot = || map.robot.to_owned();
        let geometry = &map.grid.geometry;
        let bounds = Bounds::of(&map.grid).ok_or_else(|| SearchRefusal::NoWalls { robot: robot() })?;
        let corners = bounds.corners().map(|corner| geometry.centre(corner));
        let (low, high) =
            corners.iter().fold((corners[0], corners[0]), |(low, high), corner| (low.inf(corner), high.sup(corner)));
        let extent = (high - low).max();
        if extent.is_nan() || extent > max_extent {
            return Err(SearchRefusal::TooLarge { robot: robot(), most: max_extent });
        }
        let middle = nalgebra::center(&low, &high);
        let from_middle = map.grid.occupied().map(|cell| geometry.centre(cell) - middle);
        let points: Vec<[f32; 2]> = from_middle.map(|point| [point.x as f32, point.y as f32]).collect();
        let radius = 0.5 * (high - low).norm();
        Ok(Self { middle, radius, points })
    }
}

/// The rectangle of cells that holds all occupied ones.
struct Bounds {
    first: Cell,
    last: Cell,
}

impl Bounds {
    fn of(grid: &Grid<'_>) -> Option<Self> {
        grid.occupied().fold(None, |bounds, cell| {
            let Self { first, last } = bounds.unwrap_or(Self { first: cell, last: cell });
            Some(Self {
                first: Cell { column: first.column.min(cell.column), row: first.row.min(cell.row) },
                last: Cell { column: last.column.max(cell.column), row: last.row.max(cell.row) },
            })
        })
    }

    fn corners(&self) -> [Cell; 4] {
        let Self { first, last } = self;
        [*first, Cell { column: last.column, ..*first }, *last, Cell { column: first.column, ..*last }]
    }
}

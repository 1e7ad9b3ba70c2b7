//! A map in wider cells, cropped to what is known.

use crate::geometry::{Cell, Grid, Point2, is_free, is_known, is_occupied};
use nalgebra::{UnitComplex, Vector2};

/// Cells round what is known, into which walls can be dilated.
const RIM: f64 = 2.0;

/// What a cell of a raster holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// Nothing is known of it.
    #[default]
    Unknown,
    /// It is known, and free.
    Free,
    /// It lies beside a wall, and may be one by a shift of one cell.
    BesideWall,
    /// There is a wall in it.
    Wall,
}

impl Content {
    /// Whether it is wall once walls are dilated by one cell.
    pub fn is_near_wall(self) -> bool {
        matches!(self, Self::Wall | Self::BesideWall)
    }
}

/// A map in square cells whose sides run along the axes of its frame, cropped to what is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Where the outer corner of cell (0, 0) lies, metres.
    pub corner: Vector2<f64>,
    /// The side of a cell, metres.
    pub cell: f64,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row by row.
    pub cells: Vec<Content>,
    /// The centre of every occupied cell of the map itself, in the frame of the raster, metres.
    walls: Vec<Point2>,
}

impl Raster {
    /// The raster of a grid, in the frame of the map. `None` if it would be longer than `max_extent` metres.
    ///
    /// A cell is wall if any cell of the grid in it is occupied, and free if any other is free. `cell` must be so wide
    /// that every cell in the midst of the grid gets one.
    pub fn new(grid: &Grid<'_>, cell: f64, max_extent: f64) -> Option<Self> {
        let (mut bounds, mut walls) = (Bounds::default(), Vec::new());
        for_each_known(grid, |point, value| {
            bounds.add(&point);
            if is_occupied(value) {
                walls.push(point);
            }
        });
        if bounds.0.is_some_and(|(least, most)| (most - least).max() > max_extent) {
            return None;
        }
        let mut raster = Self::unknown(&bounds, cell);
        for_each_known(grid, |point, value| {
            if let (true, Some(index)) = (is_free(value), raster.index(&point)) {
                raster.cells[index] = Content::Free;
            }
        });
        raster.draw_walls(walls);
        Some(raster)
    }

    /// The most cells along x and along y that the map takes, turned by any of some angles.
    pub fn size_turned(&self, angles: &[f64]) -> (usize, usize) {
        let sizes = angles.iter().filter_map(|angle| self.bounds_turned(*angle).size(self.cell));
        sizes.fold((0, 0), |most, size| (most.0.max(size.0), most.1.max(size.1)))
    }

    /// The same map turned about the origin of its frame.
    pub fn turned(&self, angle: f64) -> Self {
        let turn = UnitComplex::new(angle);
        let mut turned = Self::unknown(&self.bounds_turned(angle), self.cell);
        let along_x = turn.inverse() * Vector2::new(self.cell, 0.0);
        for row in 0..turned.height {
            let mut point = turn.inverse() * turned.centre(0, row);
            for cell in &mut turned.cells[row * turned.width..(row + 1) * turned.width] {
                if self.at(&point) == Content::Free {
                    *cell = Content::Free;
                }
                point += along_x;
            }
        }
        turned.draw_walls(self.walls.iter().map(|wall| turn * wall).collect());
        turned
    }

    /// The centre of a cell, metres.
    pub fn centre(&self, column: usize, row: usize) -> Point2 {
        Point2::from(self.corner + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell)
    }

    /// What is at a point.
    pub fn at(&self, point: &Point2) -> Content {
        self.index(point).map_or(Content::Unknown, |index| self.cells[index])
    }

    /// The centres of the cells with walls, row by row.
    pub fn wall_cells(&self) -> impl Iterator<Item = Point2> {
        let walls = self.cells.iter().enumerate().filter(|(_, content)| **content == Content::Wall);
        walls.map(|(index, _)| self.centre(index % self.width, index / self.width))
    }

    fn unknown(bounds: &Bounds, cell: f64) -> Self {
        let (Some((least, _)), Some((width, height))) = (bounds.0, bounds.size(cell)) else {
            return Self { cell, ..Self::default() };
        };
        let corner = least - Vector2::repeat((RIM - 0.5) * cell);
        Self { corner, cell, width, height, cells: vec![Content::Unknown; width * height], walls: Vec::new() }
    }

    fn index(&self, point: &Point2) -> Option<usize> {
        let place = (point.coords - self.corner) / self.cell;
        if !(place.x >= 0.0 && place.y >= 0.0) {
            return None;
        }
        let (column, row) = (place.x as usize, place.y as usize);
        (column < self.width && row < self.height).then(|| row * self.width + column)
    }

    /// Puts the walls into the cells, and marks those beside them.
    fn draw_walls(&mut self, walls: Vec<Point2>) {
        let with_walls: Vec<usize> = walls.iter().filter_map(|wall| self.index(wall)).collect();
        for &index in &with_walls {
            self.cells[index] = Content::Wall;
        }
        for index in with_walls {
            let (column, row) = (index % self.width, index / self.width);
            for row in row.saturating_sub(1)..=(row + 1).min(self.height - 1) {
                for column in column.saturating_sub(1)..=(column + 1).min(self.width - 1) {
                    let cell = &mut self.cells[row * self.width + column];
                    if *cell != Content::Wall {
                        *cell = Content::BesideWall;
                    }
                }
            }
        }
        self.walls = walls;
    }

    fn bounds_turned(&self, angle: f64) -> Bounds {
        let (turn, mut bounds) = (UnitComplex::new(angle), Bounds::default());
        self.rim().for_each(|point| bounds.add(&(turn * point)));
        bounds
    }

    /// The first and the last known cell of each row, which bound the map however it is turned.
    fn rim(&self) -> impl Iterator<Item = Point2> {
        let is_known = |content: &Content| *content != Content::Unknown;
        self.cells.chunks(self.width.max(1)).enumerate().flat_map(move |(row, cells)| {
            let ends = [cells.iter().position(is_known), cells.iter().rposition(is_known)];
            ends.into_iter().flatten().map(move |column| self.centre(column, row))
        })
    }
}

impl Default for Raster {
    fn default() -> Self {
        Self { corner: Vector2::zeros(), cell: 1.0, width: 0, height: 0, cells: Vec::new(), walls: Vec::new() }
    }
}

/// The least box that holds some points, if there are any.
#[derive(Default)]
struct Bounds(Option<(Vector2<f64>, Vector2<f64>)>);

impl Bounds {
    fn add(&mut self, point: &Point2) {
        let (least, most) = self.0.unwrap_or((point.coords, point.coords));
        self.0 = Some((least.inf(&point.coords), most.sup(&point.coords)));
    }

    /// The cells along x and y that it takes, with a rim.
    fn size(&self, cell: f64) -> Option<(usize, usize)> {
        let (least, most) = self.0?;
        let cells = (most - least) / cell;
        Some((cells.x as usize + 2 * RIM as usize, cells.y as usize + 2 * RIM as usize))
    }
}

/// Goes through the known cells of a grid: the centre in the map frame, and the value.
fn for_each_known(grid: &Grid<'_>, mut visit: impl FnMut(Point2, i8)) {
    for (row, cells) in grid.cells.chunks(grid.geometry.width.max(1)).enumerate() {
        for (column, &value) in cells.iter().enumerate().filter(|(_, value)| is_known(**value)) {
            visit(grid.geometry.centre(Cell { column, row }), value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{GridGeometry, UNKNOWN, pose};
    use proptest::prelude::*;

    /// A map of 6 x 4 m with a straight wall through its middle, along x, and an unknown margin.
    fn map() -> (GridGeometry, Vec<i8>) {
        let geometry = GridGeometry { width: 160, height: 120, resolution: 0.05, origin: pose(-4.0, -3.0, 0.0) };
        let value = |index: usize| match (index % 160, index / 160) {
            (20..140, 60) => 100,
            (20..140, 20..100) => 0,
            _ => UNKNOWN,
        };
        (geometry, (0..160 * 120).map(value).collect())
    }

    fn area(raster: &Raster, counts: impl Fn(Content) -> bool) -> f64 {
        raster.cells.iter().filter(|content| counts(**content)).count() as f64 * raster.cell * raster.cell
    }

    #[test]
    fn a_raster_is_cropped_to_what_is_known() {
        let (geometry, cells) = map();
        let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 100.0).unwrap();
        assert!(raster.width <= 35 && raster.height <= 25, "{} x {}", raster.width, raster.height);
        assert!((area(&raster, Content::is_near_wall) - 6.4 * 0.6).abs() < 0.3);
        assert_eq!(raster.at(&Point2::new(1.0, 0.03)), Content::Wall);
        assert_eq!(raster.at(&Point2::new(1.0, 1.0)), Content::Free);
        assert_eq!(raster.at(&Point2::new(1.0, 9.0)), Content::Unknown);
        assert!(Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 5.0).is_none());
    }

    proptest! {
        #[test]
        fn a_turn_leaves_no_holes(angle in -7.0..7.0) {
            let (geometry, cells) = map();
            let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 100.0).unwrap();
            let turned = raster.turned(angle);
            let turn = UnitComplex::new(angle);
            for step in -140..140 {
                let along = f64::from(step) * 0.02;
                prop_assert!(turned.at(&(turn * Point2::new(along, 0.03))).is_near_wall());
                prop_assert_eq!(turned.at(&(turn * Point2::new(along, 1.0))), Content::Free);
                prop_assert_eq!(turned.at(&(turn * Point2::new(along, -1.5))), Content::Free);
            }
            let free = |raster: &Raster| area(raster, |content| content == Content::Free);
            prop_assert!((free(&turned) - free(&raster)).abs() < 2.5, "{} {}", free(&turned), free(&raster));
            let (width, height) = raster.size_turned(&[angle]);
            prop_assert_eq!((width, height), (turned.width, turned.height));
        }
    }
}

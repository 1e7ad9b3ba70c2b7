//! A map in wider cells, cropped to its known part.

use super::walk::Walk;
use crate::shared::geometry::{Cell, Grid, Point2, Pose2, is_free, is_known, is_occupied};
use nalgebra::Vector2;

/// Number of cells around the known part: walls can be dilated into them, and still the outermost are unknown.
const RIM: f64 = 3.0;

/// Content of a cell of a raster. The greatest wins where several things are in one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Content {
    /// Unknown.
    #[default]
    Unknown,
    /// Known and free.
    Free,
    /// Beside a wall; it may be one by a shift of one cell.
    BesideWall,
    /// A wall.
    Wall,
}

impl Content {
    /// Whether it is wall after a dilation by one cell.
    pub fn is_near_wall(self) -> bool {
        matches!(self, Self::Wall | Self::BesideWall)
    }
}

/// A map in square cells whose sides run along the axes of its frame, cropped to its known part.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Position of the outer corner of cell (0, 0), metres.
    pub corner: Vector2<f64>,
    /// The side of a cell, metres.
    pub cell: f64,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row by row. The outermost cells are unknown.
    pub cells: Vec<Content>,
}

impl Raster {
    /// The raster of a grid, in the frame of the map. `None` if it would be longer than `max_extent` metres.
    ///
    /// A cell is wall if any cell of the grid in it is occupied, and free if any other is free. `cell` must be so
    /// wide that every cell in the middle of the grid is mapped to one.
    pub fn new(grid: &Grid<'_>, cell: f64, max_extent: f64) -> Option<Self> {
        let geometry = &grid.geometry;
        let rows = || {
            let rows = grid.cells.chunks(geometry.width.max(1)).enumerate();
            rows.filter_map(|(row, cells)| Some((row, known_range(cells, |value| is_known(*value))?, cells)))
        };
        let mut bounds = Bounds::default();
        for (row, (first, last), _) in rows() {
            for column in [first, last] {
                bounds.add(&geometry.centre(Cell { column, row }));
            }
        }
        if bounds.0.is_some_and(|(least, most)| (most - least).max() > max_extent) {
            return None;
        }
        let mut raster = Self::unknown(&bounds, cell, geometry.resolution);
        let step = geometry.origin.rotation * Vector2::new(geometry.resolution, 0.0) / cell;
        let contents: [Content; 256] = std::array::from_fn(|byte| match byte as u8 as i8 {
            value if is_occupied(value) => Content::Wall,
            value if is_free(value) => Content::Free,
            _ => Content::Unknown,
        });
        for (row, (first, last), cells) in rows() {
            let start = (geometry.centre(Cell { column: first, row }).coords - raster.corner) / cell;
            // Never below zero, as there is a rim.
            let places = Walk::new(&start, &step, raster.width);
            for (place, value) in places.zip(&cells[first..=last]) {
                let content = contents[*value as u8 as usize];
                if let (true, Some(cell)) = (content != Content::Unknown, raster.cells.get_mut(place)) {
                    *cell = content.max(*cell);
                }
            }
        }
        raster.mark_beside_walls();
        Some(raster)
    }

    /// The same map in cells twice as wide.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2) + 2, self.height.div_ceil(2) + 2);
        let corner = self.corner - Vector2::repeat(2.0 * self.cell);
        let mut halved =
            Self { corner, cell: 2.0 * self.cell, width, height, cells: vec![Content::Unknown; width * height] };
        for (row, cells) in self.cells.chunks(self.width.max(1)).enumerate() {
            let start = (row / 2 + 1) * width + 1;
            for (column, content) in cells.iter().enumerate() {
                // Cells beside walls are marked again below.
                if *content != Content::BesideWall {
                    let cell = &mut halved.cells[start + column / 2];
                    *cell = (*cell).max(*content);
                }
            }
        }
        halved.mark_beside_walls();
        halved
    }

    /// Its mirror image at the y axis.
    pub(super) fn mirrored(&self) -> Self {
        let corner = Vector2::new(-(self.corner.x + self.width as f64 * self.cell), self.corner.y);
        let rows = self.cells.chunks(self.width.max(1));
        Self { corner, cells: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..*self }
    }

    /// Union of several maps, each with its transform to the common frame. A cell is wall if it is wall in any of
    /// them. Cells are as wide as those of the first. `None` if the maps are so far apart that they cannot be
    /// connected, as the memory depends on that distance, and not on the known area.
    pub fn union(maps: &[(Pose2, &Self)]) -> Option<Self> {
        let Some((_, first)) = maps.first() else { return Some(Self::default()) };
        let (cell, mut bounds, mut reach) = (first.cell, Bounds::default(), 0.0);
        for (transform, map) in maps {
            map.for_each_end(|point| bounds.add(&(transform * point)));
            // Connected maps extend no farther than their diagonals together; with twice that there is room for gaps.
            reach += 2.0 * map.cell * (map.width as f64).hypot(map.height as f64);
        }
        // A pose that is not finite is not within reach.
        let is_within_reach = bounds.0.is_none_or(|(least, most)| (most - least).iter().all(|side| *side <= reach));
        if !is_within_reach {
            return None;
        }
        // So the cells of a map that is not turned coincide with cells.
        let mut union = Self::unknown(&bounds, cell, 0.0);
        for (transform, map) in maps {
            for (index, content) in map.cells.iter().enumerate() {
                let centre = map.centre(index % map.width, index / map.width);
                // A turned cell may leave a gap beside it; its quarters do not.
                let quarter = 0.25 * map.cell;
                let offsets: &[(f64, f64)] = match content {
                    Content::Unknown | Content::BesideWall => continue,
                    Content::Free => &[(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)],
                    Content::Wall => &[(0.0, 0.0)],
                };
                for (x, y) in offsets {
                    let point = transform * (centre + Vector2::new(*x, *y) * quarter);
                    let place = (point.coords - union.corner) / cell;
                    if let Some(cell) = union.cells.get_mut(place.y as usize * union.width + place.x as usize) {
                        *cell = (*cell).max(*content);
                    }
                }
            }
        }
        union.mark_beside_walls();
        Some(union)
    }

    /// Number of known cells.
    pub fn known_cells(&self) -> usize {
        self.cells.iter().filter(|content| **content != Content::Unknown).count()
    }

    /// Visits the centres of the first and the last known cell of each row.
    fn for_each_end(&self, mut visit: impl FnMut(Point2)) {
        for (row, cells) in self.cells.chunks(self.width.max(1)).enumerate() {
            let ends = known_range(cells, |content| *content != Content::Unknown);
            ends.into_iter().flat_map(|(first, last)| [first, last]).for_each(|column| visit(self.centre(column, row)));
        }
    }

    /// The centre of a cell, metres.
    pub fn centre(&self, column: usize, row: usize) -> Point2 {
        Point2::from(self.corner + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell)
    }

    /// Content at a point.
    pub fn at(&self, point: &Point2) -> Content {
        self.content(&((point.coords - self.corner) / self.cell))
    }

    /// The centres of the cells with walls, row by row.
    pub fn wall_cells(&self) -> impl Iterator<Item = Point2> {
        let walls = self.cells.iter().enumerate().filter(|(_, content)| **content == Content::Wall);
        walls.map(|(index, _)| self.centre(index % self.width, index / self.width))
    }

    /// A raster of unknown cells, for centres of cells of a grid within some bounds.
    fn unknown(bounds: &Bounds, cell: f64, resolution: f64) -> Self {
        let Some((least, most)) = bounds.0 else { return Self { cell, ..Self::default() } };
        let size = ((most - least) / cell).map(|cells| cells as usize + 2 * RIM as usize);
        // Half a cell of the grid is added, so that no centre is on a border between cells, where rounding would
        // decide.
        let corner = least - Vector2::repeat((RIM - 0.5) * cell + 0.5 * resolution);
        Self { corner, cell, width: size.x, height: size.y, cells: vec![Content::Unknown; size.x * size.y] }
    }

    fn mark_beside_walls(&mut self) {
        for row in 0..self.height {
            for column in 0..self.width {
                if self.cells[row * self.width + column] != Content::Wall {
                    continue;
                }
                for row in row.saturating_sub(1)..=(row + 1).min(self.height - 1) {
                    for column in column.saturating_sub(1)..=(column + 1).min(self.width - 1) {
                        let cell = &mut self.cells[row * self.width + column];
                        *cell = (*cell).max(Content::BesideWall);
                    }
                }
            }
        }
    }
}

impl Default for Raster {
    fn default() -> Self {
        Self { corner: Vector2::zeros(), cell: 1.0, width: 0, height: 0, cells: Vec::new() }
    }
}

/// Indices of the first and the last known cell of a row. Those of all rows bound the map however it is turned.
fn known_range<T>(row: &[T], is_known: impl Fn(&T) -> bool) -> Option<(usize, usize)> {
    Some((row.iter().position(&is_known)?, row.iter().rposition(&is_known)?))
}

/// Bounding box of points, if there are any.
#[derive(Default)]
pub(super) struct Bounds(pub(super) Option<(Vector2<f64>, Vector2<f64>)>);

impl Bounds {
    pub(super) fn add(&mut self, point: &Point2) {
        let (least, most) = self.0.unwrap_or((point.coords, point.coords));
        self.0 = Some((least.inf(&point.coords), most.sup(&point.coords)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::search::known_cells::KnownCells;
    use crate::shared::geometry::{GridGeometry, UNKNOWN, pose};
    use nalgebra::UnitComplex;
    use proptest::prelude::*;

    /// A map of 6 x 4 m with a straight wall through its middle, along x, and an unknown margin.
    fn map(origin_yaw: f64) -> (GridGeometry, Vec<i8>) {
        let origin = pose(0.0, 0.0, origin_yaw) * pose(-4.0, -3.0, 0.0);
        let geometry = GridGeometry { width: 160, height: 120, resolution: 0.05, origin };
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
    fn a_mirror_image_has_at_each_point_what_the_map_has_at_the_opposite_one() {
        let (geometry, cells) = map(0.3);
        let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 100.0).unwrap();
        let mirrored = raster.mirrored();
        for row in 0..raster.height {
            for column in 0..raster.width {
                let centre = raster.centre(column, row);
                assert_eq!(mirrored.at(&Point2::new(-centre.x, centre.y)), raster.at(&centre));
            }
        }
        assert_ne!(mirrored.cells, raster.cells);
    }

    #[test]
    fn a_union_holds_the_cells_of_its_maps() {
        let (geometry, cells) = map(0.0);
        let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.1, 100.0).unwrap();
        let alone = Raster::union(&[(Pose2::identity(), &raster)]).unwrap();
        for (index, content) in raster.cells.iter().enumerate() {
            let centre = raster.centre(index % raster.width, index / raster.width);
            assert_eq!(alone.at(&centre), *content, "{centre}");
        }
        let moved = pose(20.0, 5.0, 0.7);
        let union = Raster::union(&[(Pose2::identity(), &raster), (moved, &raster)]).unwrap();
        for step in -28..28 {
            let along = 0.1 * f64::from(step);
            for place in [Pose2::identity(), moved] {
                assert_eq!(union.at(&(place * Point2::new(along, 1.0))), Content::Free);
                assert!(union.at(&(place * Point2::new(along, 0.03))).is_near_wall());
            }
        }
        assert!((union.known_cells() as f64 / raster.known_cells() as f64 - 2.0).abs() < 0.1);
        assert_eq!(Raster::union(&[]).unwrap().known_cells(), 0);
        for far in [pose(10_000.0, 0.0, 0.0), pose(0.0, 1e300, 0.0), pose(f64::NAN, 0.0, 0.0)] {
            assert_eq!(Raster::union(&[(Pose2::identity(), &raster), (far, &raster)]), None);
        }
    }

    #[test]
    fn a_raster_is_cropped_to_what_is_known() {
        let (geometry, cells) = map(0.0);
        let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 100.0).unwrap();
        assert!(raster.width <= 35 && raster.height <= 25, "{} x {}", raster.width, raster.height);
        assert!((area(&raster, Content::is_near_wall) - 6.4 * 0.6).abs() < 0.3);
        assert_eq!(raster.at(&Point2::new(1.0, 0.03)), Content::Wall);
        assert_eq!(raster.at(&Point2::new(1.0, 1.0)), Content::Free);
        assert_eq!(raster.at(&Point2::new(1.0, 9.0)), Content::Unknown);
        assert!(Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.2, 5.0).is_none());
        let (least, size) = KnownCells::new(&raster).box_turned(0.0);
        assert!((least.x + 3.0).abs() < 0.4 && (size.y - 4.0).abs() < 0.6, "{least} {size}");
    }

    proptest! {
        #[test]
        fn a_turned_grid_leaves_no_holes_and_wider_cells_hold_the_same(yaw in -7.0..7.0) {
            let (geometry, cells) = map(yaw);
            let raster = Raster::new(&Grid::new(geometry, &cells).unwrap(), 0.1, 100.0).unwrap();
            let turn = UnitComplex::new(yaw);
            for raster in [raster.halved(), raster] {
                for step in -140..140 {
                    let along = f64::from(step) * 0.02;
                    prop_assert!(raster.at(&(turn * Point2::new(along, 0.03))).is_near_wall());
                    prop_assert_eq!(raster.at(&(turn * Point2::new(along, 1.0))), Content::Free);
                    prop_assert_eq!(raster.at(&(turn * Point2::new(along, -1.5))), Content::Free);
                }
                let known = area(&raster, |content| content != Content::Unknown);
                prop_assert!((known - 24.0).abs() < 4.5, "{known}");
            }
        }
    }
}

//! Floor plans, and robots' maps of them.

use crate::shared::geometry::{Cell, Grid, GridGeometry, Point2, Pose2, UNKNOWN};
use crate::shared::walls::{NORMAL_RADIUS, WallMap};
use gridweave_runtime::ros::MapMetaData;
use nalgebra::Vector2;

/// Half of a wall's thickness, metres.
const HALF_WALL: f64 = 0.06;

/// Straight walls in the frame of the world.
#[derive(Clone, Debug)]
pub struct FloorPlan {
    walls: Vec<(Point2, Point2)>,
}

/// The part of the world that a robot sees: the rectangle between two corners, metres.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The corner with the least coordinates.
    pub low: Point2,
    /// The corner with the greatest coordinates.
    pub high: Point2,
}

/// Pose of a map's frame, and how the map is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawing {
    /// `T_world_map`.
    pub transform_world_map: Pose2,
    /// Metres per cell.
    pub resolution: f64,
    /// Yaw of the grid in the map's frame, radians.
    pub grid_yaw: f64,
}

/// A drawn map.
#[derive(Debug)]
pub struct DrawnMap {
    /// Geometry of its cells.
    pub geometry: GridGeometry,
    /// Row by row: -1 unknown, 0 free, 100 occupied.
    pub cells: Vec<i8>,
    /// Its walls.
    pub walls: WallMap,
    /// `T_world_map`: the true pose of its frame.
    pub transform_world_map: Pose2,
}

/// The part of the world between the corners (x1, y1) and (x2, y2), metres.
pub fn seen(x1: f64, y1: f64, x2: f64, y2: f64) -> Seen {
    Seen { low: Point2::new(x1, y1), high: Point2::new(x2, y2) }
}

impl FloorPlan {
    /// A plan of walls from (x1, y1) to (x2, y2), metres.
    pub fn new(walls: &[[f64; 4]]) -> Self {
        Self { walls: walls.iter().map(|[x1, y1, x2, y2]| (Point2::new(*x1, *y1), Point2::new(*x2, *y2))).collect() }
    }

    /// The same with more walls.
    pub fn with(mut self, walls: &[[f64; 4]]) -> Self {
        self.walls.extend(Self::new(walls).walls);
        self
    }

    /// An office of 20 x 12 m: a corridor, rooms of all sizes with doors, and one slanted wall.
    pub fn office() -> Self {
        Self::hall().with(&[
            [0.0, 5.0, 2.0, 5.0],
            [3.0, 5.0, 6.5, 5.0],
            [7.6, 5.0, 12.2, 5.0],
            [13.0, 5.0, 18.1, 5.0],
            [0.0, 7.0, 4.3, 7.0],
            [5.3, 7.0, 9.0, 7.0],
            [10.0, 7.0, 15.4, 7.0],
            [16.4, 7.0, 20.0, 7.0],
            [4.5, 0.0, 4.5, 5.0],
            [8.8, 0.0, 8.8, 5.0],
            [14.1, 0.0, 14.1, 5.0],
            [6.0, 7.0, 6.0, 12.0],
            [12.3, 7.0, 12.3, 12.0],
            [16.0, 9.0, 18.5, 11.0],
            [9.8, 1.5, 11.0, 1.5],
        ])
    }

    /// What two robots map of the office, in frames of their own: its west, and its east.
    pub fn west_and_east_of_the_office() -> (DrawnMap, DrawnMap) {
        let a = Self::office().draw(seen(-0.2, -0.2, 14.0, 12.2), drawing(3.0, 2.0, 0.4));
        let b = Self::office().draw(seen(5.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
        (a, b)
    }

    /// Another office of the same size.
    pub fn another_office() -> Self {
        Self::hall().with(&[
            [0.0, 3.4, 5.0, 3.4],
            [6.2, 3.4, 15.0, 3.4],
            [10.5, 3.4, 10.5, 10.0],
            [3.3, 5.0, 3.3, 12.0],
            [12.0, 8.8, 20.0, 8.8],
            [6.9, 5.9, 6.9, 9.1],
            [16.7, 0.0, 16.7, 6.6],
        ])
    }

    /// A hall of 20 x 12 m that looks the same after half a turn.
    pub fn hall() -> Self {
        Self::new(&[[0.0, 0.0, 20.0, 0.0], [20.0, 0.0, 20.0, 12.0], [20.0, 12.0, 0.0, 12.0], [0.0, 12.0, 0.0, 0.0]])
    }

    /// A building of 20 m x 12 m that looks the same after half a turn.
    pub fn symmetric() -> Self {
        let mut walls = vec![];
        for [x1, y1, x2, y2] in [
            [0.0, 0.0, 20.0, 0.0],
            [0.0, 0.0, 0.0, 12.0],
            [4.0, 0.0, 4.0, 4.0],
            [4.0, 5.0, 9.0, 5.0],
            [12.0, 0.0, 12.0, 5.0],
            [15.0, 3.0, 20.0, 3.0],
        ] {
            walls.extend([[x1, y1, x2, y2], [20.0 - x1, 12.0 - y1, 20.0 - x2, 12.0 - y2]]);
        }
        Self::new(&walls)
    }

    /// A building of 20 x 12 m whose two halves are the same but for one short wall.
    pub fn nearly_symmetric() -> Self {
        Self::symmetric().with(&[[9.0, 8.0, 9.8, 8.0]])
    }

    /// A straight corridor without an end, 2 m wide.
    pub fn corridor() -> Self {
        Self::new(&[[-100.0, -1.0, 100.0, -1.0], [-100.0, 1.0, 100.0, 1.0]])
    }

    /// The plan as a mirror along the x axis shows it, at the height of its middle.
    pub fn mirrored(&self, middle: f64) -> Self {
        let mirror = |point: &Point2| Point2::new(point.x, 2.0 * middle - point.y);
        Self { walls: self.walls.iter().map(|(p, q)| (mirror(p), mirror(q))).collect() }
    }

    /// The map of a robot that has seen a part of the plan.
    pub fn draw(&self, part: Seen, drawing: Drawing) -> DrawnMap {
        let Drawing { transform_world_map, resolution, grid_yaw } = drawing;
        let turn = nalgebra::UnitComplex::new(grid_yaw);
        // The smallest grid of that yaw that contains what was seen.
        let (low, high) = (part.low, part.high);
        let corners = [low, Point2::new(high.x, low.y), high, Point2::new(low.x, high.y)];
        let corners = corners.map(|corner| turn.inverse() * (transform_world_map.inverse() * corner));
        let least = corners.iter().fold(Point2::new(f64::MAX, f64::MAX), |least, corner| least.inf(corner));
        let most = corners.iter().fold(Point2::new(f64::MIN, f64::MIN), |most, corner| most.sup(corner));
        let margin = Vector2::repeat(0.5);
        let size = (most - least + 2.0 * margin) / resolution;
        let origin = Pose2::from_parts((turn * (least - margin)).coords.into(), turn);
        let geometry = GridGeometry { width: size.x as usize, height: size.y as usize, resolution, origin };
        let mut cells = Vec::with_capacity(geometry.cell_count());
        for row in 0..geometry.height {
            for column in 0..geometry.width {
                let point = transform_world_map * geometry.centre(Cell { column, row });
                let inside = (low.x..high.x).contains(&point.x) && (low.y..high.y).contains(&point.y);
                cells.push(if inside { self.value(&point) } else { UNKNOWN });
            }
        }
        let grid = Grid::new(geometry, &cells).unwrap();
        let walls = WallMap::new(&grid, NORMAL_RADIUS);
        DrawnMap { geometry, cells, walls, transform_world_map }
    }

    fn value(&self, point: &Point2) -> i8 {
        let on_wall = self.walls.iter().any(|(start, end)| {
            let along = end - start;
            let share = ((point - start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (start + along * share - point).norm() <= HALF_WALL
        });
        if on_wall { 100 } else { 0 }
    }
}

impl DrawnMap {
    /// Meta data of the grid's message.
    pub fn info(&self) -> MapMetaData {
        MapMetaData {
            resolution: self.geometry.resolution as f32,
            width: self.geometry.width as u32,
            height: self.geometry.height as u32,
            origin: self.geometry.origin.into(),
            ..Default::default()
        }
    }

    /// The cells as in a message.
    pub fn bytes(&self) -> Vec<u8> {
        self.cells.iter().map(|cell| *cell as u8).collect()
    }

    /// The grid of its cells.
    pub fn grid(&self) -> Grid<'_> {
        Grid::new(self.geometry, &self.cells).unwrap()
    }

    /// This map deformed by drift: every point is displaced by [`deformation_at`].
    pub fn deformed(&self, most: f64) -> Self {
        let grid = self.grid();
        let cells = (0..self.cells.len()).map(|index| {
            let cell = Cell { column: index % self.geometry.width, row: index / self.geometry.width };
            let shown = self.geometry.centre(cell);
            grid.value_at(&(0..5).fold(shown, |place, _| shown - deformation_at(most, &place)))
        });
        let cells: Vec<i8> = cells.collect();
        let walls = WallMap::new(&Grid::new(self.geometry, &cells).unwrap(), NORMAL_RADIUS);
        Self { cells, walls, ..*self }
    }

    /// True `T_self_other`.
    pub fn transform_to(&self, other: &Self) -> Pose2 {
        self.transform_world_map.inverse() * other.transform_world_map
    }
}

/// Displacement of a point of a deformed map: up to `most` metres along x and along y, in waves that are longer than
/// a building.
pub fn deformation_at(most: f64, place: &Point2) -> Vector2<f64> {
    most * Vector2::new((place.y / 7.0).sin(), (place.x / 13.0).sin())
}

/// A map in cells of 0.05 m whose frame is at (x, y), metres, turned by `yaw` radians.
pub fn drawing(x: f64, y: f64, yaw: f64) -> Drawing {
    Drawing { transform_world_map: crate::shared::geometry::pose(x, y, yaw), resolution: 0.05, grid_yaw: 0.0 }
}

/// Distance of two transforms: metres in the plan's middle, and radians.
pub fn apart(one: &Pose2, other: &Pose2, map_b: &DrawnMap) -> (f64, f64) {
    let middle = map_b.transform_world_map.inverse() * Point2::new(10.0, 6.0);
    ((one * middle - other * middle).norm(), one.rotation.angle_to(&other.rotation).abs())
}

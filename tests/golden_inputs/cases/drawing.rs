//! Floor plans, and maps of them as robots would draw them.

use gridweave_stages::shared::geometry::{Cell, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use gridweave_tests::TestMap;
use nalgebra::Vector2;

/// Straight walls in the frame of the building: x and y of one end and of the other, metres.
pub(super) struct FloorPlan {
    pub(super) walls: Vec<[f64; 4]>,
    /// Half of the walls' thickness, metres.
    pub(super) half_wall: f64,
}

/// What a robot maps, and how.
#[derive(Clone, Copy)]
pub(super) struct View {
    /// The part of the building that it sees, between two corners, metres.
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
    /// The pose of its map frame in the building.
    pub(super) transform_building_map: Pose2,
    /// Yaw of the grid in the map frame, radians.
    pub(super) grid_yaw: f64,
    /// Metres a cell.
    pub(super) resolution: f32,
}

impl View {
    /// A part of the building, the map frame being the building's.
    pub(super) fn of(low: [f64; 2], high: [f64; 2], resolution: f32) -> Self {
        Self { low, high, transform_building_map: Pose2::identity(), grid_yaw: 0.0, resolution }
    }
}

impl FloorPlan {
    pub(super) fn new(walls: &[[f64; 4]]) -> Self {
        Self { walls: walls.to_vec(), half_wall: 0.06 }
    }

    /// A room between two corners, its walls in the order right, top, left, bottom.
    pub(super) fn room(low: [f64; 2], high: [f64; 2]) -> Self {
        let ([x1, y1], [x2, y2]) = (low, high);
        Self::new(&[[x2, y1, x2, y2], [x2, y2, x1, y2], [x1, y2, x1, y1], [x1, y1, x2, y1]])
    }

    /// A room with a corner cut out, so that no two walls are of one length: 8, 5, 4.5, 3.5, 3 and 2 m.
    pub(super) fn angular_room() -> Self {
        Self::new(&[
            [0.5, 0.5, 8.5, 0.5],
            [8.5, 0.5, 8.5, 5.5],
            [8.5, 5.5, 5.0, 5.5],
            [5.0, 5.5, 5.0, 3.5],
            [5.0, 3.5, 0.5, 3.5],
            [0.5, 3.5, 0.5, 0.5],
        ])
    }

    /// An office of 14 x 10 m: rooms of several sizes on both sides of a corridor, their doors, and a slanted wall.
    pub(super) fn office() -> Self {
        let mut plan = Self::room([0.0, 0.0], [14.0, 10.0]);
        plan.walls.extend([
            [0.0, 4.0, 1.2, 4.0],
            [2.1, 4.0, 5.6, 4.0],
            [6.5, 4.0, 9.3, 4.0],
            [10.2, 4.0, 14.0, 4.0],
            [0.0, 6.0, 3.4, 6.0],
            [4.3, 6.0, 8.0, 6.0],
            [8.9, 6.0, 11.6, 6.0],
            [12.5, 6.0, 14.0, 6.0],
            [3.8, 0.0, 3.8, 4.0],
            [8.1, 0.0, 8.1, 4.0],
            [5.3, 6.0, 5.3, 10.0],
            [10.7, 6.0, 10.7, 10.0],
            [6.4, 8.9, 7.9, 7.7],
        ]);
        plan
    }

    /// Another office with the same outer walls.
    pub(super) fn another_office() -> Self {
        let mut plan = Self::room([0.0, 0.0], [14.0, 10.0]);
        plan.walls.extend([
            [0.0, 2.9, 4.1, 2.9],
            [5.0, 2.9, 12.0, 2.9],
            [6.3, 2.9, 6.3, 8.2],
            [2.7, 4.4, 2.7, 10.0],
            [8.4, 7.3, 14.0, 7.3],
            [10.0, 0.0, 10.0, 5.5],
            [4.6, 5.2, 4.6, 7.9],
        ]);
        plan
    }

    /// The plan turned about the building's origin, radians.
    pub(super) fn turned(mut self, angle: f64) -> Self {
        for [x1, y1, x2, y2] in &mut self.walls {
            for (x, y) in [(x1, y1), (x2, y2)] {
                let turned = pose(0.0, 0.0, angle) * Point2::new(*x, *y);
                (*x, *y) = (turned.x, turned.y);
            }
        }
        self
    }

    /// The map of a robot: free where it sees, occupied on walls, unknown elsewhere.
    pub(super) fn draw(&self, view: &View) -> TestMap {
        let View { low, high, transform_building_map, grid_yaw, resolution } = *view;
        let transform_grid_building = (transform_building_map * pose(0.0, 0.0, grid_yaw)).inverse();
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]].map(|corner| {
            let corner = transform_grid_building * Point2::from(corner);
            corner / f64::from(resolution)
        });
        let least = corners.iter().fold(corners[0], |least, corner| least.inf(corner)).map(f64::floor);
        let most = corners.iter().fold(corners[0], |most, corner| most.sup(corner)).map(f64::ceil);
        let margin = Vector2::repeat(3.0);
        let size = most - least + 2.0 * margin;
        let corner = pose(0.0, 0.0, grid_yaw) * ((least - margin) * f64::from(resolution));
        let mut map =
            TestMap::filled(size.x as u32, size.y as u32, resolution, UNKNOWN).at(corner.x, corner.y, grid_yaw);

        let geometry = GridGeometry::from(&map.info);
        for row in 0..geometry.height {
            for column in 0..geometry.width {
                let cell = Cell { column, row };
                let place = transform_building_map * geometry.centre(cell);
                if (low[0]..high[0]).contains(&place.x) && (low[1]..high[1]).contains(&place.y) {
                    map.cells[geometry.index(cell)] = if self.is_wall(&place) { 100 } else { 0 };
                }
            }
        }
        map
    }

    fn is_wall(&self, place: &Point2) -> bool {
        self.walls.iter().any(|&[x1, y1, x2, y2]| {
            let (start, along) = (Point2::new(x1, y1), Vector2::new(x2 - x1, y2 - y1));
            let share = ((place - start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (start + along * share - place).norm() <= self.half_wall
        })
    }
}

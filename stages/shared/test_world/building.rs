//! The map of a building of any size.

use crate::shared::geometry::{Cell, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use nalgebra::Vector2;

const RESOLUTION: f64 = 0.05;
/// Mean width of a room, metres.
const ROOM: f64 = 5.0;
const HALF_WALL: f64 = 0.06;
/// Half the width of a door, metres.
const HALF_DOOR: f64 = 0.5;

/// The map of a robot that has seen a square of `known` metres of a building, all of it, its frame turned by `yaw`.
pub fn draw(cells: usize, known: f64, yaw: f64) -> (GridGeometry, Vec<i8>) {
    draw_deformed(cells, known, &pose(0.0, 0.0, yaw), 0.0)
}

/// The map of a robot that has seen a square of `known` metres around the origin of its frame, deformed by up to
/// `most` metres along x and along y, in waves that are longer than a building.
pub fn draw_deformed(cells: usize, known: f64, transform_building_map: &Pose2, most: f64) -> (GridGeometry, Vec<i8>) {
    let half = 0.5 * cells as f64 * RESOLUTION;
    let origin = Pose2::translation(-half, -half);
    let geometry = GridGeometry { width: cells, height: cells, resolution: RESOLUTION, origin };
    let middle = transform_building_map * Point2::origin();
    let values = (0..cells * cells).map(|index| {
        let cell = Cell { column: index % cells, row: index / cells };
        let shown = geometry.centre(cell);
        let point =
            transform_building_map * (shown + most * Vector2::new((shown.y / 7.0).sin(), (shown.x / 13.0).sin()));
        let is_inside = (point.x - middle.x).abs().max((point.y - middle.y).abs()) < 0.5 * known;
        if is_inside { value(&point) } else { UNKNOWN }
    });
    let values = values.collect();
    (geometry, values)
}

/// What is at a point of a building without end: rooms of all widths, with doors.
fn value(point: &Point2) -> i8 {
    let (across, along) = (wall_near(point.y, 0), wall_near(point.x, 1000 + cell_of(point.y)));
    let is_wall = |distance: f64, door: f64| distance.abs() < HALF_WALL && door.abs() > HALF_DOOR;
    let door_across = point.x - (f64::from(cell_of(point.x)) + 0.2 + 0.6 * spread(cell_of(point.x), across.1)) * ROOM;
    let door_along = point.y - (f64::from(cell_of(point.y)) + 0.3 + 0.4 * spread(cell_of(point.y), along.1)) * ROOM;
    if is_wall(across.0, door_across) || is_wall(along.0, door_along) { 100 } else { 0 }
}

fn cell_of(along: f64) -> i32 {
    (along / ROOM).floor() as i32
}

/// The signed distance from the wall near a place along an axis, and the number of the wall.
fn wall_near(along: f64, row: i32) -> (f64, i32) {
    let number = cell_of(along);
    (along - (f64::from(number) + 0.3 + 0.4 * spread(number, row)) * ROOM, number)
}

/// A number from 0 to 1 that looks random, for two whole numbers.
fn spread(one: i32, other: i32) -> f64 {
    let mixed = (one as u32).wrapping_mul(0x9e37_79b9) ^ (other as u32).wrapping_mul(0x85eb_ca6b);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d);
    f64::from(mixed >> 8) / f64::from(1 << 24)
}

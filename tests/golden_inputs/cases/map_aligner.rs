//! Inputs of `map_aligner`: maps of two robots or more.

use super::drawing::{FloorPlan, View};
use super::{Case, pair};
use gridweave_stages::shared::geometry::{Pose2, UNKNOWN, pose};
use gridweave_tests::{LogBuilder, TestMap};

const CELL: f32 = 0.1;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("map_aligner", name, write);
    vec![
        case("two_overlapping_maps", maps),
        case("turned_origins_and_resolutions", |log| {
            log.map(1.0, "robot1", &place().draw(&View { grid_yaw: 0.6, ..left() }));
            log.map(2.0, "robot2", &place().draw(&View { grid_yaw: -1.1, resolution: 0.08, ..right() }));
        }),
        case("rotations_two_degrees_apart", maps),
        case("not_provisional", maps),
        case("same_after_half_a_turn", |log| {
            let hall = FloorPlan::room([0.5, 0.5], [13.5, 9.5]);
            pair(log, &hall.draw(&left()), &hall.draw(&right()));
        }),
        case("bare_corridor", |log| {
            let corridor = FloorPlan::new(&[[0.0, 0.5, 30.0, 0.5], [0.0, 2.5, 30.0, 2.5]]);
            log.map(1.0, "robot1", &corridor.draw(&View::of([0.0, 0.0], [24.0, 3.0], CELL)));
            log.map(2.0, "robot2", &corridor.draw(&View { high: [30.0, 3.0], ..right() }));
        }),
        case("another_building", |log| pair(log, &place().draw(&left()), &FloorPlan::another_office().draw(&right()))),
        case("a_corner_in_common", |log| {
            log.map(1.0, "robot1", &place().draw(&View { high: [3.0, 3.0], ..left() }));
            log.map(2.0, "robot2", &place().draw(&View { low: [-0.2, -0.2], high: [4.0, 2.5], ..right() }));
        }),
        case("empty_map", |log| {
            pair(log, &place().draw(&left()), &TestMap::filled(100, 80, CELL, 0));
            log.map(3.0, "robot2", &TestMap::filled(100, 80, CELL, UNKNOWN));
            log.map(4.0, "robot2", &TestMap::filled(0, 0, CELL, 0));
        }),
        case("one_point", |log| {
            let mut point = TestMap::filled(100, 80, CELL, 0);
            point.cells[40 * 100 + 50] = 100;
            pair(log, &place().draw(&left()), &point);
        }),
        case("all_occupied", |log| pair(log, &TestMap::filled(80, 70, CELL, 100), &TestMap::filled(80, 70, CELL, 100))),
        case("too_long", |log| {
            let mut long = TestMap::filled(5000, 2, CELL, UNKNOWN);
            (long.cells[0], long.cells[4999]) = (100, 100);
            pair(log, &place().draw(&left()), &long);
        }),
        case("not_a_map", |log| {
            log.raw(1.0, "/robot1/map", "nav_msgs/msg/OccupancyGrid", &[0, 1, 0, 0, 9]);
            log.map(2.0, "robot2", &TestMap::filled(3, 3, 0.0, 0));
            log.map(3.0, "robot1", &place().draw(&left()));
        }),
        case("sent_again", |log| {
            maps(log);
            log.map(3.0, "robot1", &place().draw(&left()));
            log.map(4.0, "robot2", &place().draw(&View { low: [1.0, -0.2], ..right() }));
        }),
        case("three_robots", |log| {
            maps(log);
            let third = View { transform_building_map: pose(-2.0, 5.0, -0.7), ..left() };
            log.map(3.0, "robot3", &place().draw(&third));
        }),
    ]
}

/// What robot1 sees of the place; its map frame is the building's.
pub(super) fn left() -> View {
    View::of([-0.2, -0.2], [11.5, 10.2], CELL)
}

/// What robot2 sees, in its own map frame.
pub(super) fn right() -> View {
    View { transform_building_map: truth(), ..View::of([2.0, -0.2], [14.2, 10.2], CELL) }
}

/// `T_1_2`.
fn truth() -> Pose2 {
    pose(8.0, 3.0, 2.0)
}

/// An L of 14 x 10 m with rooms of all sizes and slanted walls, which looks the same from nowhere else.
pub(super) fn place() -> FloorPlan {
    FloorPlan::new(&[
        [0.0, 0.0, 14.0, 0.0],
        [14.0, 0.0, 14.0, 6.6],
        [14.0, 6.6, 8.2, 6.6],
        [8.2, 6.6, 8.2, 10.0],
        [8.2, 10.0, 0.0, 10.0],
        [0.0, 10.0, 0.0, 0.0],
        [0.0, 2.9, 2.2, 2.9],
        [3.2, 2.9, 6.4, 2.9],
        [4.1, 0.0, 4.1, 2.9],
        [6.4, 1.1, 6.4, 5.0],
        [6.4, 5.0, 9.4, 3.7],
        [10.4, 3.4, 12.2, 2.5],
        [10.5, 6.6, 10.5, 4.7],
        [2.1, 4.9, 2.1, 10.0],
        [2.1, 6.6, 4.6, 6.6],
        [5.4, 6.6, 6.3, 8.2],
    ])
}

pub(super) fn maps(log: &mut LogBuilder) {
    pair(log, &place().draw(&left()), &place().draw(&right()));
}

//! Inputs of `line_extractor`: drawn maps.

use super::Case;
use super::drawing::{FloorPlan, View};
use gridweave_stages::shared::geometry::pose;
use gridweave_tests::{LogBuilder, TestMap};
use std::f64::consts::FRAC_PI_4;

const CELL: f32 = 0.05;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("line_extractor", name, write);
    vec![
        case("room", |log| draw(log, &FloorPlan::angular_room(), [9.0, 6.0])),
        case("paper", |log| {
            let view = View::of([0.0, 0.0], [5.0, 4.0], 0.02);
            log.map(
                1.0,
                "robot1",
                &FloorPlan { half_wall: 0.02, ..FloorPlan::room([0.5, 0.5], [4.5, 3.5]) }.draw(&view),
            );
        }),
        case("walls_at_45_degrees", |log| {
            let plan = FloorPlan::angular_room().turned(FRAC_PI_4);
            log.map(1.0, "robot1", &plan.draw(&View::of([-4.5, -0.5], [6.5, 10.5], CELL)));
        }),
        case("one_direction", |log| {
            draw(log, &FloorPlan::new(&[[0.0, 1.0, 8.0, 1.0], [0.0, 3.0, 8.0, 3.0]]), [8.0, 4.0]);
        }),
        case("door", |log| {
            let door_and_crack =
                [[0.5, 1.0, 3.0, 1.0], [3.9, 1.0, 7.5, 1.0], [0.5, 3.0, 3.0, 3.0], [3.3, 3.0, 7.0, 3.0]];
            draw(log, &FloorPlan::new(&door_and_crack), [8.0, 4.0]);
        }),
        case("collinear_pieces", collinear_pieces),
        case("collinear_pieces_apart", collinear_pieces),
        case("short_and_faint", short_and_faint),
        case("turned_origin", |log| {
            let view = View::of([0.0, 0.0], [9.0, 6.0], CELL);
            let (transform_building_map, grid_yaw) = (pose(2.0, -3.0, 0.4), 0.7);
            let plan = FloorPlan::angular_room();
            log.map(1.0, "robot1", &plan.draw(&View { transform_building_map, grid_yaw, ..view }));
        }),
        case("empty_map", |log| {
            log.map(1.0, "free", &TestMap::filled(40, 30, CELL, 0));
            log.map(2.0, "unknown", &TestMap::filled(40, 30, CELL, -1));
            log.map(3.0, "no_cells", &TestMap::filled(0, 0, CELL, 0));
        }),
        case("one_point", |log| {
            let mut map = TestMap::filled(40, 30, CELL, 0);
            map.cells[15 * 40 + 20] = 100;
            log.map(1.0, "robot1", &map);
        }),
        case("all_occupied", |log| {
            log.map(1.0, "robot1", &TestMap::filled(60, 40, CELL, 100));
        }),
        case("solid_block", |log| {
            let mut map = TestMap::filled(60, 50, CELL, 0);
            for row in 10..30 {
                map.cells[row * 60 + 10..row * 60 + 50].fill(100);
            }
            log.map(1.0, "robot1", &map);
        }),
        case("no_maps", no_maps),
    ]
}

/// What a robot sees of the building from its origin to a corner, metres.
fn draw(log: &mut LogBuilder, plan: &FloorPlan, corner: [f64; 2]) {
    log.map(1.0, "robot1", &plan.draw(&View::of([0.0, 0.0], corner, CELL)));
}

/// Two pieces on one line, and a third aside.
fn collinear_pieces(log: &mut LogBuilder) {
    let pieces = [[0.5, 1.0, 3.0, 1.0], [3.3, 1.0, 5.0, 1.0], [5.3, 1.6, 7.5, 1.6]];
    draw(log, &FloorPlan::new(&pieces), [8.0, 2.5]);
}

/// A wall of 2 m, one of 0.5 m, and one of 2 m of which every third cell is occupied.
fn short_and_faint(log: &mut LogBuilder) {
    let mut map = TestMap::filled(60, 40, CELL, 0);
    for column in 10..50 {
        map.cells[5 * 60 + column] = 100;
        if column < 20 {
            map.cells[20 * 60 + column] = 100;
        }
        if column % 3 == 0 {
            map.cells[35 * 60 + column] = 100;
        }
    }
    log.map(1.0, "robot1", &map);
}

/// Maps that cannot be, and one that can.
fn no_maps(log: &mut LogBuilder) {
    let good = FloorPlan::room([0.5, 0.5], [3.5, 2.5]).draw(&View::of([0.0, 0.0], [4.0, 3.0], CELL));
    let mut too_few_cells = good.clone();
    too_few_cells.cells.truncate(100);
    let mut no_resolution = good.clone();
    no_resolution.info.resolution = 0.0;
    log.map(1.0, "robot1", &too_few_cells);
    log.map(2.0, "robot1", &no_resolution);
    log.map(3.0, "robot1", &good.clone().at(f64::NAN, 0.0, 0.0));
    log.raw(4.0, "/robot1/map", "nav_msgs/msg/OccupancyGrid", &[0, 1, 0, 0, 7]);
    log.map(5.0, "robot1", &good);
}

//! Inputs of `map_selector`: maps that grow.

use super::Case;
use super::drawing::{FloorPlan, View};
use super::icp_refiner::{CELL, left, right};
use gridweave_tests::{LogBuilder, TestMap};

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("map_selector", name, write);
    vec![
        case("growing_maps", growing),
        case("all_maps", growing),
        case("cells_that_do_not_coincide", |log| {
            let map = FloorPlan::office().draw(&left());
            log.map(1.0, "robot1", &map.clone().at(0.0, 0.0, 0.0));
            log.map(2.0, "robot1", &map.clone().at(0.04, 0.0, 0.0));
            log.map(3.0, "robot1", &map.at(0.04, 0.0, 0.3));
        }),
        case("empty_map", |log| {
            log.map(1.0, "robot1", &TestMap::filled(100, 80, CELL, -1));
            log.map(2.0, "robot1", &TestMap::filled(0, 0, CELL, 0));
            log.map(3.0, "robot1", &TestMap::filled(100, 80, CELL, 0));
        }),
        case("wrong_cell_count", |log| {
            let mut wrong = TestMap::filled(100, 80, CELL, 0);
            wrong.cells.pop();
            log.map(1.0, "robot1", &wrong);
            log.map(2.0, "robot1", &TestMap::filled(100, 80, CELL, 0));
        }),
    ]
}

/// Two robots that see more and more of an office, to the east.
fn growing(log: &mut LogBuilder) {
    for (number, seconds) in (0_u8..8).zip(1_u8..) {
        let seen = f64::from(number);
        let one = View { high: [4.0 + seen, 10.2], ..left() };
        let other = View { high: [4.5 + 0.2 * seen, 10.2], ..right() };
        log.map(f64::from(seconds), "robot1", &FloorPlan::office().draw(&one));
        log.map(f64::from(seconds) + 0.5, "robot2", &FloorPlan::office().draw(&other));
    }
}

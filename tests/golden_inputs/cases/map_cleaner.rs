//! Inputs of `map_cleaner`: maps with what is no wall.

use super::Case;
use super::drawing::FloorPlan;
use super::icp_refiner::{CELL, left};
use gridweave_tests::TestMap;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("map_cleaner", name, write);
    vec![
        case("legs_and_rays", |log| {
            let mut map = FloorPlan::office().draw(&left());
            let width = map.info.width as usize;
            // A speck in every hundred free cells, and a ray of two cells into unknown space.
            for (index, cell) in map.cells.iter_mut().enumerate() {
                let (column, row) = (index % width, index / width);
                if *cell == 0 && (column * 31 + row * 17) % 97 == 0 {
                    *cell = 100;
                }
                if *cell == -1 && (row == 3 || row == 4) {
                    *cell = 0;
                }
            }
            log.map(1.0, "robot1", &map);
        }),
        case("clean_already", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&left()));
        }),
        case("empty_map", |log| {
            log.map(1.0, "robot1", &TestMap::filled(100, 80, CELL, -1));
            log.map(2.0, "robot1", &TestMap::filled(0, 0, CELL, 0));
        }),
    ]
}

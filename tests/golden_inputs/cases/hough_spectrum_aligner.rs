//! Inputs of `hough_spectrum_aligner`: maps of two robots.

use super::Case;
use super::drawing::{FloorPlan, View};
use super::map_aligner::{left, maps, place, right};
use gridweave_stages::shared::geometry::UNKNOWN;
use gridweave_tests::TestMap;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("hough_spectrum_aligner", name, write);
    vec![
        case("two_overlapping_maps", maps),
        case("turned_origins_and_resolutions", |log| {
            log.map(1.0, "robot1", &place().draw(&View { grid_yaw: 0.6, ..left() }));
            log.map(2.0, "robot2", &place().draw(&View { grid_yaw: -1.1, resolution: 0.08, ..right() }));
        }),
        case("same_after_half_a_turn", |log| {
            let hall = FloorPlan::room([0.5, 0.5], [13.5, 9.5]);
            log.map(1.0, "robot1", &hall.draw(&left()));
            log.map(2.0, "robot2", &hall.draw(&right()));
        }),
        case("another_building", |log| {
            log.map(1.0, "robot1", &place().draw(&left()));
            log.map(2.0, "robot2", &FloorPlan::another_office().draw(&right()));
        }),
        case("empty_map", |log| {
            log.map(1.0, "robot1", &place().draw(&left()));
            log.map(2.0, "robot2", &TestMap::filled(100, 80, 0.1, UNKNOWN));
        }),
    ]
}

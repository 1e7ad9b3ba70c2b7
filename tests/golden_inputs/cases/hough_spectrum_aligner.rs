//! Inputs of `hough_spectrum_aligner`: maps of two robots.

use super::drawing::{FloorPlan, View};
use super::map_aligner::{left, maps, place, right};
use super::{Case, pair};
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
            pair(log, &hall.draw(&left()), &hall.draw(&right()));
        }),
        case("another_building", |log| pair(log, &place().draw(&left()), &FloorPlan::another_office().draw(&right()))),
        case("empty_map", |log| pair(log, &place().draw(&left()), &TestMap::filled(100, 80, 0.1, UNKNOWN))),
    ]
}

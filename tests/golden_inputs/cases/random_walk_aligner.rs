//! Inputs of `random_walk_aligner`: maps of two robots.

use super::drawing::{FloorPlan, View};
use super::map_aligner::{left, place, right};
use super::{Case, pair};
use gridweave_stages::shared::geometry::UNKNOWN;
use gridweave_tests::TestMap;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("random_walk_aligner", name, write);
    vec![
        case("one_place", |log| {
            log.map(1.0, "robot1", &place().draw(&View { high: [14.2, 10.2], ..left() }));
            log.map(2.0, "robot2", &place().draw(&View { low: [-0.2, -0.2], grid_yaw: 0.5, ..right() }));
        }),
        case("another_building", |log| pair(log, &place().draw(&left()), &FloorPlan::another_office().draw(&right()))),
        case("empty_map", |log| pair(log, &place().draw(&left()), &TestMap::filled(100, 80, 0.1, UNKNOWN))),
    ]
}

//! Inputs of `elastic_refiner`: maps of one building and their poses.

use super::drawing::FloorPlan;
use super::grid_fuser::place;
use super::icp_refiner::{CELL, left, right, truth};
use super::{Case, pair};
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap};

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("elastic_refiner", name, write);
    vec![
        case("stretched_map", stretched),
        case("rigid", stretched),
        case("maps_that_are_not_bent", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::office().draw(&right()));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", truth())]);
        }),
        case("map_that_grows", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &TestMap::filled(100, 80, CELL, -1));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", truth())]);
            log.map(4.0, "robot2", &FloorPlan::office().draw(&right()));
        }),
        case("one_robot", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&left()));
            place(log, 2.0, &[("robot1", Pose2::identity()), ("robot2", truth())]);
        }),
        case("absurd_frames", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::office().draw(&right()));
            for (second, x) in [f64::NAN, f64::INFINITY, 1e200].into_iter().enumerate() {
                place(log, 3.0 + second as f64, &[("robot1", Pose2::identity()), ("robot2", pose(x, 0.0, 0.0))]);
            }
        }),
    ]
}

/// The second robot takes each metre for 1.01 m.
fn stretched(log: &mut LogBuilder) {
    let mut map = FloorPlan::office().draw(&left());
    log.map(1.0, "robot1", &map);
    map.info.resolution = 1.01 * CELL;
    log.map(2.0, "robot2", &map);
    place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", Pose2::identity())]);
}

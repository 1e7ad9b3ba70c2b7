//! Inputs of `icp_refiner`: maps of two robots, and an initial guess of their relative pose.

use super::drawing::{FloorPlan, View};
use super::{Case, pair};
use gridweave_runtime::ros::Alignment;
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};
use nalgebra::{UnitComplex, Vector2};

pub(super) const CELL: f32 = 0.05;

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("icp_refiner", name, write);
    vec![
        case("two_overlapping_maps", overlapping),
        case("point_to_point", overlapping),
        case("turned_origins_and_resolutions", |log| {
            let office = FloorPlan::office();
            let left = View { grid_yaw: 0.6, ..left() };
            let right = View { grid_yaw: -1.1, resolution: 0.08, ..right() };
            pair(log, &office.draw(&left), &office.draw(&right));
            guess(log, 3.0, &off(&truth(), 0.15, -0.1, 0.03));
        }),
        case("no_overlap", |log| {
            let office = FloorPlan::office();
            log.map(1.0, "robot1", &office.draw(&View { high: [5.0, 10.0], ..left() }));
            log.map(2.0, "robot2", &office.draw(&View { low: [9.0, 0.0], ..right() }));
            guess(log, 3.0, &truth());
        }),
        case("bare_corridor", |log| {
            let corridor = FloorPlan::new(&[[0.0, 0.5, 30.0, 0.5], [0.0, 2.5, 30.0, 2.5]]);
            log.map(1.0, "robot1", &corridor.draw(&View::of([0.0, 0.0], [24.0, 3.0], CELL)));
            log.map(2.0, "robot2", &corridor.draw(&View { high: [30.0, 3.0], ..right() }));
            vague_guess(log, 3.0, &truth(), 0.3);
        }),
        case("far_from_the_guess", |log| {
            maps(log);
            guess(log, 3.0, &off(&truth(), 0.9, 0.0, 0.0));
        }),
        case("empty_map", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &TestMap::filled(100, 80, CELL, 0));
            guess(log, 3.0, &truth());
            log.map(4.0, "robot2", &TestMap::filled(100, 80, CELL, -1));
            log.map(5.0, "robot2", &TestMap::filled(0, 0, CELL, 0));
        }),
        case("one_point", |log| {
            let mut point = TestMap::filled(100, 80, CELL, 0);
            point.cells[40 * 100 + 50] = 100;
            pair(log, &FloorPlan::office().draw(&left()), &point);
            guess(log, 3.0, &truth());
        }),
        case("all_occupied", |log| {
            pair(log, &TestMap::filled(160, 140, CELL, 100), &TestMap::filled(160, 140, CELL, 100));
            guess(log, 3.0, &pose(0.0, 0.0, 0.0));
        }),
        case("refused_first_guess", |log| {
            maps(log);
            let refused = Alignment {
                header: header(3.0, "robot1/map"),
                a: "robot1".into(),
                b: "robot2".into(),
                source: "tags".into(),
                method: "tags".into(),
                reason: "robot1 and robot2 have no tag in common; robot1 knows 4 tags, robot2 0".into(),
                ..Default::default()
            };
            log.message(3.0, "/quadrants/alignment", &refused);
        }),
        case("no_map_of_one", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&left()));
            guess(log, 3.0, &truth());
        }),
        case("not_a_number", |log| {
            maps(log);
            guess(log, 3.0, &pose(f64::NAN, 0.0, 0.0));
            log.raw(4.0, "/quadrants/alignment", "gridweave_msgs/msg/Alignment", &[0, 1, 0, 0, 9]);
            log.map(5.0, "robot2", &TestMap::filled(3, 3, 0.0, 0));
        }),
        case("sent_again", |log| {
            overlapping(log);
            // The first guess hardly moves; then another map comes.
            guess(log, 4.0, &off(&truth(), 0.11, -0.1, 0.02));
            log.map(5.0, "robot2", &FloorPlan::office().draw(&View { low: [4.0, 0.0], ..right() }));
        }),
    ]
}

/// What robot1 sees of the office; its map frame is the building's.
pub(super) fn left() -> View {
    View::of([-0.2, -0.2], [11.0, 10.2], CELL)
}

/// What robot2 sees, in its own map frame.
pub(super) fn right() -> View {
    View { transform_building_map: truth(), ..View::of([3.0, -0.2], [14.2, 10.2], CELL) }
}

/// `T_1_2`.
pub(super) fn truth() -> Pose2 {
    pose(8.0, 3.0, 2.0)
}

pub(super) fn maps(log: &mut LogBuilder) {
    pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::office().draw(&right()));
}

/// Two maps of one office that share most of it, and a guess that is off by 0.14 m and 1.1 degrees.
fn overlapping(log: &mut LogBuilder) {
    maps(log);
    guess(log, 3.0, &off(&truth(), 0.1, -0.1, 0.02));
}

/// A transform moved by (x, y) metres and turned about the origin of map b by `yaw` radians.
pub(super) fn off(transform_a_b: &Pose2, x: f64, y: f64, yaw: f64) -> Pose2 {
    let mut off = *transform_a_b;
    off.translation.vector += Vector2::new(x, y);
    off.rotation *= UnitComplex::new(yaw);
    off
}

/// A first guess that is known to 0.1 m and 0.02 rad.
fn guess(log: &mut LogBuilder, seconds: f64, transform_a_b: &Pose2) {
    vague_guess(log, seconds, transform_a_b, 0.1);
}

/// A first guess that is known to so many metres and 0.02 rad.
fn vague_guess(log: &mut LogBuilder, seconds: f64, transform_a_b: &Pose2, deviation: f64) {
    let variance = deviation * deviation;
    let mut alignment = Alignment {
        header: header(seconds, "robot1/map"),
        a: "robot1".into(),
        b: "robot2".into(),
        covariance: [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 0.0004],
        score: 0.8,
        source: "tags".into(),
        method: "tags+directions".into(),
        accepted: true,
        reason: "4 common tags".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(transform_a_b);
    log.message(seconds, "/quadrants/alignment", &alignment);
}

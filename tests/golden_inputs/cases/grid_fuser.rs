//! Inputs of `grid_fuser`: maps and their poses.

use super::drawing::{FloorPlan, View};
use super::{Case, pair};
use gridweave_runtime::ros::{RobotFrame, RobotFrames, UnmergedRobot};
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};
use nalgebra::{Isometry2, Translation2};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("grid_fuser", name, write);
    vec![
        case("equations_14_and_15", equations_14_and_15),
        case("equations_14_and_15_inverse", equations_14_and_15),
        case("conditional_mean", conditional_mean),
        case("conditional_mean_inverse", conditional_mean),
        case("evidence", evidence),
        case("conflicts", conflicts),
        case("conflicts_forward", conflicts),
        case("conflicts_apart", |log| {
            log.map(1.0, "robot1", &grid(2, &[0, 100])).map(2.0, "robot2", &grid(2, &[100, 0]));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", pose(2.0, 0.0, 0.0))]);
        }),
        case("conflicts_of_resolutions", |log| {
            let mut coarse = grid(2, &[0, 100]);
            coarse.info.resolution = 2.0;
            log.map(1.0, "robot1", &coarse).map(2.0, "robot2", &grid(4, &[0, 0, 100, 0, 0, 100, 100, 100]));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", Pose2::identity())]);
        }),
        case("turned_origin", |log| {
            let turned = grid(3, &[100, 0, 0, 0, 0, 50]).at(2.0, 0.0, FRAC_PI_2);
            pair(log, &turned, &grid(2, &[20, 30]).at(0.0, 0.0, PI));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", pose(5.0, 2.0, 0.0))]);
        }),
        case("two_resolutions", |log| {
            let mut coarse = grid(2, &[0, 100, -1, 50]);
            coarse.info.resolution = 0.1;
            let mut fine = grid(2, &[0, 0, 0, 0]).at(-0.1, 0.0, 0.0);
            fine.info.resolution = 0.05;
            log.map(1.0, "robot1", &coarse).map(2.0, "robot2", &fine);
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", Pose2::identity())]);
        }),
        case("given_resolution", |log| {
            log.map(1.0, "robot1", &grid(2, &[0, 100]));
            place(log, 2.0, &[("robot1", Pose2::identity())]);
        }),
        case("empty_map", |log| {
            log.map(1.0, "robot1", &grid(2, &[-1, -1])).map(2.0, "robot2", &TestMap::filled(0, 0, 1.0, 0));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", pose(0.5, 0.0, 0.0))]);
            log.map(4.0, "robot2", &grid(2, &[0, 100]));
        }),
        case("one_point", |log| one_point(log, FRAC_PI_2)),
        case("one_point_forward", |log| one_point(log, 0.3)),
        case("all_occupied", |log| {
            for (seconds, robot) in [(1.0, "robot1"), (2.0, "robot2")] {
                log.map(seconds, robot, &TestMap::filled(6, 5, 1.0, 100));
            }
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", pose(6.0, 1.0, FRAC_PI_4))]);
        }),
        case("when_it_is_sent", when_it_is_sent),
        case("absurd_frames", |log| {
            log.map(1.0, "robot1", &grid(1, &[0])).map(2.0, "robot2", &grid(1, &[100]));
            for (second, x) in [f64::NAN, f64::INFINITY, -5e4].into_iter().enumerate() {
                place(log, 3.0 + second as f64, &[("robot1", Pose2::identity()), ("robot2", pose(x, 0.0, 0.0))]);
            }
            log.raw(7.0, TOPIC, "gridweave_msgs/msg/RobotFrames", &[0, 1, 0, 0, 9]);
            log.map(8.0, "robot1", &grid(1, &[0]).at(f64::NAN, 0.0, 0.0));
        }),
        case("rooms", |log| {
            let office = FloorPlan::office();
            let other =
                View { transform_building_map: pose(8.0, 3.0, 2.0), ..View::of([6.0, -0.2], [14.2, 10.2], 0.1) };
            log.map(
                1.0,
                "robot1",
                &FloorPlan { half_wall: 0.08, ..office }.draw(&View::of([-0.2, -0.2], [8.0, 10.2], 0.1)),
            );
            log.map(2.0, "robot2", &FloorPlan { half_wall: 0.08, ..FloorPlan::office() }.draw(&other));
            place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", other.transform_building_map)]);
        }),
    ]
}

const TOPIC: &str = "/robot_frames";

/// Cells of one metre, row by row.
fn grid(width: u32, cells: &[i8]) -> TestMap {
    TestMap { cells: cells.to_vec(), ..TestMap::filled(width, cells.len() as u32 / width, 1.0, 0) }
}

/// Poses of robots in the map of robot1.
pub(super) fn place(log: &mut LogBuilder, seconds: f64, placed: &[(&str, Pose2)]) {
    let frame = |(robot, transform): &(&str, Pose2)| RobotFrame {
        robot: (*robot).into(),
        frame_id: format!("{robot}/map"),
        x: transform.translation.x,
        y: transform.translation.y,
        yaw: transform.rotation.angle(),
        covariance: [0.0; 9],
    };
    let frames = RobotFrames {
        header: header(seconds, RobotFrames::WORLD),
        reference: "robot1".into(),
        frames: placed.iter().map(frame).collect(),
        unmerged: vec![UnmergedRobot { robot: "robot9".into(), reason: "no alignment".into() }],
        groups: Vec::new(),
    };
    log.message(seconds, TOPIC, &frames);
}

/// The 25 points 98 to 102 squared, turned by 30 degrees about (200, 200) and moved to (300, 300).
///
/// The paper's points are whole numbers, and a grid's are the middles of its cells. Values of 10 and 20 in turn
/// distinguish a cell that was carried over from a hole that was filled with a mean. The reference's map, one cell that
/// lies apart, makes the cells of the output those of whole numbers.
fn equations_14_and_15(log: &mut LogBuilder) {
    let cells: Vec<i8> = (0..25).map(|index| if index % 2 == 0 { 10 } else { 20 }).collect();
    pair(log, &grid(1, &[40]).at(255.0, 163.0, 0.0), &grid(5, &cells).at(97.5, 97.5, 0.0));
    let turn = Isometry2::rotation(30_f64.to_radians());
    let transform = Translation2::new(300.0, 300.0) * turn * Translation2::new(-200.0, -200.0);
    place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", transform)]);
}

/// A gap between walls and free space, an unknown area beside them, a gap in a thick wall, and the inner corner of an
/// unknown area.
fn conditional_mean(log: &mut LogBuilder) {
    #[rustfmt::skip]
    let cells = [
        100, 100, 100, -1, -1, -1, 90, 90, 90, -1, -1, 30, 30, 30,
         10,  -1,  10, -1, -1, -1, 90, -1, 90, -1, -1, 30, -1, -1,
         20,  20,  20, -1, -1, -1, 90, 90, 90, -1, -1, 30, -1, -1,
    ];
    log.map(1.0, "robot1", &grid(14, &cells));
    place(log, 2.0, &[("robot1", Pose2::identity())]);
}

/// A free cell, and a map of which one cell is known, turned by an angle.
fn one_point(log: &mut LogBuilder, angle: f64) {
    log.map(1.0, "robot1", &grid(1, &[0])).map(2.0, "robot2", &grid(3, &[-1, -1, -1, -1, 100, -1]));
    place(log, 3.0, &[("robot1", Pose2::identity()), ("robot2", pose(2.0, 1.0, angle))]);
}

/// One row for each of two maps: free, occupied, undecided and unknown against each other.
fn evidence(log: &mut LogBuilder) {
    log.map(1.0, "robot1", &grid(10, &[0, 0, 0, 0, 100, 100, 100, 50, -1, 70]));
    log.map(2.0, "robot2", &grid(10, &[0, 100, 50, -1, 100, 50, -1, 50, 30, 70]));
    log.map(3.0, "robot3", &grid(10, &[0, 0, -1, -1, 0, -1, -1, 50, -1, 70]));
    let all = ["robot1", "robot2", "robot3"].map(|robot| (robot, Pose2::identity()));
    place(log, 4.0, &all[..2]);
    place(log, 5.0, &all);
}

/// One row for each of two maps, and then of three: what is known to one, what agrees, and what contradicts, surely and
/// less so.
fn conflicts(log: &mut LogBuilder) {
    pair(log, &grid(9, &[0, -1, 0, 100, 100, 70, 70, 50, 100]), &grid(9, &[-1, 100, 0, 100, 0, 0, 30, 100, 30]));
    log.map(3.0, "robot3", &grid(9, &[-1, 0, 100, 50, -1, 70, -1, 0, 0]));
    let all = ["robot1", "robot2", "robot3"].map(|robot| (robot, Pose2::identity()));
    place(log, 4.0, &all[..2]);
    place(log, 5.0, &all);
}

/// A robot that is not placed, frames that hardly change, one that does, another map, and a robot that is lost again.
fn when_it_is_sent(log: &mut LogBuilder) {
    let frames = |x: f64| [("robot1", Pose2::identity()), ("robot2", pose(x, 0.0, 0.0))];
    log.map(1.0, "robot1", &grid(2, &[0, 100])).map(2.0, "robot2", &grid(1, &[60])).map(3.0, "robot3", &grid(1, &[0]));
    place(log, 4.0, &frames(3.0));
    place(log, 5.0, &frames(3.01));
    place(log, 6.0, &frames(4.0));
    log.map(7.0, "robot2", &grid(1, &[70]));
    log.map(8.0, "robot3", &grid(1, &[100]));
    place(log, 9.0, &frames(4.0)[..1]);
    place(log, 10.0, &[("robot1", pose(0.001, 0.0, 0.0))]);
}

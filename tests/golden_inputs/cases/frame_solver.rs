//! Inputs of `frame_solver`: who has a map, and alignments of pairs.

use super::Case;
use gridweave_runtime::ros::{Alignment, OccupancyGrid};
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("frame_solver", name, write);
    vec![
        case("two_robots", |log| {
            maps(log, 2);
            align(log, 2.0, 1, 2, &true_transform(1, 2));
        }),
        case("chain_of_three", |log| {
            maps(log, 3);
            align(log, 2.0, 1, 2, &true_transform(1, 2));
            // The other way round: robot3's map in robot2's is wanted.
            align(log, 3.0, 3, 2, &true_transform(3, 2));
        }),
        case("cycle_of_three", |log| {
            maps(log, 3);
            align(log, 2.0, 1, 2, &(true_transform(1, 2) * pose(0.03, 0.0, 0.0)));
            align(log, 3.0, 2, 3, &(true_transform(2, 3) * pose(0.0, 0.03, 0.002)));
            align(log, 4.0, 1, 3, &(true_transform(1, 3) * pose(-0.03, 0.0, -0.002)));
        }),
        case("contradicting_pair", |log| {
            maps(log, 4);
            let mut seconds = 2.0;
            for a in 1..=4 {
                for b in a + 1..=4 {
                    let wrong = if (a, b) == (2, 3) { pose(2.0, 0.0, 0.5) } else { Pose2::identity() };
                    align(log, seconds, a, b, &(true_transform(a, b) * wrong));
                    seconds += 1.0;
                }
            }
        }),
        case("contradiction_of_three", |log| {
            maps(log, 3);
            align(log, 2.0, 1, 2, &true_transform(1, 2));
            align(log, 3.0, 2, 3, &true_transform(2, 3));
            align(log, 4.0, 1, 3, &(true_transform(1, 3) * pose(2.0, 0.0, 0.5)));
        }),
        case("unmerged_robot", |log| {
            maps(log, 4);
            align(log, 2.0, 1, 2, &true_transform(1, 2));
            refuse(log, 3.0, 1, 3, 0.4, "the maps overlap by 3 m2, and at least 40 m2 are needed");
            refuse(log, 4.0, 2, 3, 0.6, "the maps contradict each other");
        }),
        case("chosen_reference", |log| {
            maps(log, 3);
            align(log, 2.0, 1, 2, &true_transform(1, 2));
            align(log, 3.0, 2, 3, &true_transform(2, 3));
        }),
        case("one_robot", |log| {
            maps(log, 1);
            refuse(log, 2.0, 1, 2, 0.0, "robot1 and robot2 have no tag in common");
        }),
        case("frame_names", |log| {
            for (seconds, robot, frame_id) in
                [(0.1, "robot1", "map"), (0.2, "robot2", "robot2_map"), (0.3, "robot3", ""), (0.4, "robot4", "/odom")]
            {
                let header = header(seconds, frame_id);
                log.message(seconds, &format!("/{robot}/map"), &OccupancyGrid { header, ..Default::default() });
            }
            for b in 2..=4 {
                align(log, f64::from(b), 1, b, &true_transform(1, b));
            }
        }),
        case("not_a_number", |log| {
            maps(log, 4);
            align(log, 2.0, 1, 2, &pose(f64::NAN, 0.0, 0.0));
            let mut negative = alignment(3.0, 1, 3, &true_transform(1, 3));
            negative.covariance[0] = -1.0;
            log.message(3.0, TOPIC, &negative);
            align(log, 4.0, 1, 4, &pose(1e9, 0.0, 0.0));
            align(log, 5.0, 2, 2, &true_transform(1, 2));
            log.raw(6.0, TOPIC, "gridweave_msgs/msg/Alignment", &[0, 1, 0, 0, 9]);
        }),
        case("small_changes", |log| {
            maps(log, 2);
            for (seconds, metres) in [(2.0, 0.0), (3.0, 0.005), (4.0, 0.1), (5.0, 0.105)] {
                align(log, seconds, 1, 2, &(true_transform(1, 2) * pose(metres, 0.0, 0.0)));
            }
        }),
        case("two_groups", |log| {
            maps(log, 4);
            align(log, 2.0, 3, 4, &true_transform(3, 4));
            align(log, 3.0, 1, 2, &true_transform(1, 2));
            refuse(log, 4.0, 2, 3, 0.6, "the maps contradict each other");
        }),
        case("groups_that_meet", |log| {
            maps(log, 4);
            align(log, 2.0, 3, 4, &true_transform(3, 4));
            align(log, 3.0, 1, 2, &true_transform(1, 2));
            align(log, 4.0, 2, 3, &true_transform(2, 3));
        }),
        case("later_robot", |log| {
            for (seconds, robot) in [(0.1, 2), (0.2, 3), (3.0, 1)] {
                log.map(seconds, &format!("robot{robot}"), &TestMap::filled(2, 2, 0.05, 0));
            }
            align(log, 2.0, 2, 3, &true_transform(2, 3));
            align(log, 4.0, 1, 3, &true_transform(1, 3));
        }),
    ]
}

const TOPIC: &str = "/icp/alignment";

/// The pose of a robot's map in the building.
fn transform_building(robot: u32) -> Pose2 {
    match robot {
        1 => Pose2::identity(),
        2 => pose(4.0, -2.0, 0.5),
        3 => pose(-1.0, 6.0, -2.0),
        _ => pose(9.0, 5.0, 3.1),
    }
}

/// `T_a_b`.
fn true_transform(a: u32, b: u32) -> Pose2 {
    transform_building(a).inverse() * transform_building(b)
}

/// A map of each of so many robots.
fn maps(log: &mut LogBuilder, robots: u32) {
    for robot in 1..=robots {
        log.map(0.1 * f64::from(robot), &format!("robot{robot}"), &TestMap::filled(2, 2, 0.05, 0));
    }
}

fn alignment(seconds: f64, a: u32, b: u32, transform_a_b: &Pose2) -> Alignment {
    let mut alignment = Alignment {
        header: header(seconds, format!("robot{a}/map")),
        a: format!("robot{a}"),
        b: format!("robot{b}"),
        covariance: [1e-4, 2e-5, 0.0, 2e-5, 2e-4, 1e-6, 0.0, 1e-6, 1e-6],
        score: 0.9,
        source: "tags".into(),
        method: "tags+directions+icp".into(),
        accepted: true,
        reason: "4 common tags".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(transform_a_b);
    alignment
}

fn align(log: &mut LogBuilder, seconds: f64, a: u32, b: u32, transform_a_b: &Pose2) {
    log.message(seconds, TOPIC, &alignment(seconds, a, b, transform_a_b));
}

fn refuse(log: &mut LogBuilder, seconds: f64, a: u32, b: u32, score: f64, reason: &str) {
    let accepted = alignment(seconds, a, b, &true_transform(a, b));
    log.message(seconds, TOPIC, &Alignment { accepted: false, score, reason: reason.into(), ..accepted });
}

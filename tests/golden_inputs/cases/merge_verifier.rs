//! Inputs of `merge_verifier`: maps of two robots, and hypotheses of their relative pose.

use super::drawing::{FloorPlan, View};
use super::icp_refiner::{CELL, left, maps, off, right, truth};
use super::{Case, pair};
use gridweave_runtime::ros::Alignment;
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("merge_verifier", name, write);
    vec![
        case("by_tags", |log| {
            maps(log);
            propose(log, 3.0, &by_tags(&truth()));
        }),
        case("by_few_tags", |log| {
            maps(log);
            propose(log, 3.0, &Alignment { provisional: true, ..by_tags(&truth()) });
        }),
        case("the_second_hypothesis_is_right", |log| {
            whole_maps(log, &FloorPlan::office());
            by_maps(log, 3.0, &[off(&truth(), 1.5, 0.0, 0.0), truth(), off(&truth(), 0.0, 2.0, 0.3)]);
        }),
        case("same_after_half_a_turn", |log| {
            whole_maps(log, &hall());
            by_maps(log, 3.0, &[truth(), half_turn()]);
        }),
        case("tags_decide_after_half_a_turn", |log| {
            whole_maps(log, &hall());
            by_maps(log, 3.0, &[half_turn(), truth()]);
            propose(log, 4.0, &by_tags(&truth()));
        }),
        case("tags_and_maps_differ", |log| {
            whole_maps(log, &FloorPlan::office());
            propose(log, 3.0, &by_tags(&off(&truth(), 1.0, 1.0, 0.0)));
            by_maps(log, 4.0, &[truth()]);
        }),
        case("another_building", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::another_office().draw(&right()));
            propose(log, 3.0, &by_tags(&truth()));
        }),
        case("stretched_map", |log| {
            // The second robot takes each metre for 1.06 m.
            let mut map = FloorPlan::office().draw(&left());
            log.map(1.0, "robot1", &map);
            map.info.resolution *= 1.06;
            log.map(2.0, "robot2", &map);
            by_maps(log, 3.0, &[pose(0.0, 0.0, 0.0), pose(-0.3, -0.3, 0.0)]);
        }),
        case("mirrored", |log| {
            let mut mirrored = FloorPlan::office();
            mirrored.walls.iter_mut().for_each(|wall| (wall[1], wall[3]) = (10.0 - wall[1], 10.0 - wall[3]));
            pair(log, &FloorPlan::office().draw(&left()), &mirrored.draw(&right()));
            propose(log, 3.0, &by_tags(&truth()));
        }),
        case("no_overlap", |log| {
            let office = FloorPlan::office();
            log.map(1.0, "robot1", &office.draw(&View { high: [5.0, 10.0], ..left() }));
            log.map(2.0, "robot2", &office.draw(&View { low: [9.0, 0.0], ..right() }));
            propose(log, 3.0, &by_tags(&truth()));
        }),
        case("all_occupied", |log| {
            pair(log, &TestMap::filled(160, 140, CELL, 100), &TestMap::filled(160, 140, CELL, 100));
            propose(log, 3.0, &by_tags(&pose(0.0, 0.0, 0.0)));
        }),
        case("empty_map", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &TestMap::filled(100, 80, CELL, -1));
            propose(log, 3.0, &by_tags(&truth()));
            log.map(4.0, "robot2", &TestMap::filled(0, 0, CELL, 0));
        }),
        case("refused_before", |log| {
            maps(log);
            let nothing = |source: &str, reason: &str| Alignment {
                header: header(3.0, "robot1/map"),
                a: "robot1".into(),
                b: "robot2".into(),
                source: source.into(),
                method: source.into(),
                reason: reason.into(),
                ..Default::default()
            };
            propose(log, 3.0, &nothing("maps", "the map of robot2 has no walls"));
            propose(log, 3.5, &nothing("tags", "robot1 and robot2 have no tag in common"));
        }),
        case("no_map_of_one", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&left()));
            propose(log, 3.0, &by_tags(&truth()));
        }),
        case("not_a_number", |log| {
            maps(log);
            propose(log, 3.0, &by_tags(&pose(f64::NAN, 0.0, 0.0)));
            log.raw(4.0, TOPIC, "gridweave_msgs/msg/Alignment", &[0, 1, 0, 0, 9]);
            propose(log, 5.0, &Alignment { rank: 1, hypotheses: 2, ..by_tags(&truth()) });
        }),
        case("a_map_comes_again", |log| {
            maps(log);
            propose(log, 3.0, &by_tags(&truth()));
            log.map(4.0, "robot2", &FloorPlan::office().draw(&right()));
            log.map(5.0, "robot2", &FloorPlan::another_office().draw(&right()));
        }),
    ]
}

const TOPIC: &str = "/icp/alignment";

/// Both robots have seen all of a building of 14 x 10 m.
fn whole_maps(log: &mut LogBuilder, plan: &FloorPlan) {
    pair(log, &plan.draw(&View { high: [14.2, 10.2], ..left() }), &plan.draw(&View { low: [-0.2, -0.2], ..right() }));
}

/// A hall with two alcoves, which looks the same after half a turn.
fn hall() -> FloorPlan {
    FloorPlan::new(&[
        [0.0, 0.0, 14.0, 0.0],
        [14.0, 0.0, 14.0, 10.0],
        [14.0, 10.0, 0.0, 10.0],
        [0.0, 10.0, 0.0, 0.0],
        [4.0, 0.0, 4.0, 3.0],
        [10.0, 10.0, 10.0, 7.0],
        [0.0, 6.0, 5.0, 6.0],
        [14.0, 4.0, 9.0, 4.0],
    ])
}

/// `T_1_2` if the hall is taken for itself after half a turn.
fn half_turn() -> Pose2 {
    pose(14.0, 10.0, std::f64::consts::PI) * truth()
}

fn by_tags(transform_a_b: &Pose2) -> Alignment {
    let mut alignment = Alignment {
        a: "robot1".into(),
        b: "robot2".into(),
        covariance: [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-6],
        score: 0.8,
        source: "tags".into(),
        method: "tags+directions+icp".into(),
        accepted: true,
        reason: "4 common tags; walls lie within 0.020 m of each other".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(transform_a_b);
    alignment
}

fn by_maps(log: &mut LogBuilder, seconds: f64, places: &[Pose2]) {
    for (rank, place) in places.iter().enumerate() {
        let hypothesis = Alignment {
            provisional: true,
            rank: rank as u32,
            hypotheses: places.len() as u32,
            source: "maps".into(),
            method: "maps+icp".into(),
            margin: 0.3,
            reason: "the maps alone; walls lie within 0.020 m of each other".into(),
            ..by_tags(place)
        };
        propose(log, seconds, &hypothesis);
    }
}

fn propose(log: &mut LogBuilder, seconds: f64, alignment: &Alignment) {
    log.message(seconds, TOPIC, &Alignment { header: header(seconds, "robot1/map"), ..alignment.clone() });
}

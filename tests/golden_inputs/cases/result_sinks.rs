//! Inputs of the sinks that write results: summaries, map files, pictures and truths.

use super::Case;
use gridweave_runtime::ros::{
    Alignment, CommonPlace, MapAgreement, OccupancyGrid, RobotFrame, RobotFrames, RobotGroup, SimulationTruth,
    TrueFrame, TrueTag, UnmergedRobot, Verdict, Verdicts,
};
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new("summary_sink", "four_robots", |log| {
            log.message(1.0, "/robot_frames", &RobotFrames { reference: "robot1".into(), ..Default::default() });
            log.message(2.0, "/robot_frames", &frames()).message(2.0, "/verdicts", &verdicts());
            let agreement =
                MapAgreement { known_to_one: 12.5, known_to_several: 8.0, in_conflict: 0.5, ..Default::default() };
            log.message(3.0, "/map_agreement", &agreement);
        }),
        Case::new("summary_sink", "nothing_merged", |log| {
            log.message(1.0, "/verdicts", &verdicts());
            log.message(1.0, "/robot_frames", &RobotFrames::default());
        }),
        Case::new("map_file_sink", "the_last_map", |log| {
            in_world(log, 1.0, "/map", &TestMap::filled(3, 2, 0.05, 0));
            let mut last = TestMap::filled(4, 2, 0.05, 0).at(1.5, -2.25, 0.5);
            last.cells = vec![0, 100, -1, 50, 24, 25, 64, 65];
            in_world(log, 2.0, "/map", &last);
        }),
        Case::new("picture_sink", "two_robots", |log| {
            in_world(log, 1.0, "/map", &TestMap::room());
            in_world(log, 2.0, "/robot1/merged_map", &TestMap::room());
            in_world(log, 2.0, "/robot2/merged_map", &TestMap::room().at(1.5, -0.75, 0.45));
        }),
        Case::new("picture_sink", "no_robot_is_placed", |log| in_world(log, 1.0, "/map", &TestMap::room())),
        Case::new("truth_sink", "two_robots", |log| {
            let frame =
                |robot: &str, x: f64| TrueFrame { robot: robot.into(), x, y: 2.0, yaw: -0.5, centre: [3.0, 4.0] };
            let truth = SimulationTruth {
                header: header(1.0, "robot1/map"),
                resolution: 0.05,
                frames: vec![frame("robot1", 0.0), frame("robot2", 7.25)],
                tags: vec![TrueTag { tag_id: "tag00".into(), x: 1.0, y: -1.0 }],
                common: vec![CommonPlace { first: [1.0, 2.0], second: [3.0, 4.0] }],
            };
            log.message(1.0, "/truth", &truth);
        }),
    ]
}

fn in_world(log: &mut LogBuilder, seconds: f64, topic: &str, map: &TestMap) {
    let data: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
    log.message(seconds, topic, &OccupancyGrid { header: header(seconds, "world"), info: map.info, data: &data });
}

/// Two robots that are merged, and two that are merged with each other only.
fn frames() -> RobotFrames {
    let frame = |robot: &str, x: f64| RobotFrame {
        robot: robot.into(),
        frame_id: format!("{robot}/map"),
        x,
        y: -0.5 * x,
        yaw: 0.1 * x,
        covariance: [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-6],
    };
    let unmerged =
        |robot: &str| UnmergedRobot { robot: robot.into(), reason: "it shares too little with robot1".into() };
    RobotFrames {
        header: header(2.0, RobotFrames::WORLD),
        reference: "robot1".into(),
        frames: vec![frame("robot1", 0.0), frame("robot2", 4.5)],
        unmerged: vec![unmerged("robot3"), unmerged("robot4")],
        groups: vec![RobotGroup {
            reference: "robot3".into(),
            frame_id: "world/robot3".into(),
            frames: vec![frame("robot3", 0.0), frame("robot4", -3.0)],
        }],
    }
}

fn verdicts() -> Verdicts {
    let verdict = |a: &str, b: &str, accepted: bool| Verdict {
        alignment: Alignment {
            a: a.into(),
            b: b.into(),
            source: "maps".into(),
            has_transform: true,
            x: 4.5,
            y: -2.25,
            yaw: 0.45,
            score: if accepted { 0.98 } else { 0.125 },
            method: "maps+icp".into(),
            accepted,
            reason: if accepted { "walls agree" } else { "the maps share 12 m2" }.into(),
            ..Default::default()
        },
        checked: accepted,
    };
    let verdicts = vec![verdict("robot1", "robot2", true), verdict("robot1", "robot3", false)];
    Verdicts { header: header(2.0, RobotFrames::WORLD), verdicts }
}

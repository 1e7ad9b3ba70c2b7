//! Inputs of `map_placer` and `path_placer`: a room, a path through it, its pose and its deformation.

use super::Case;
use super::grid_fuser::place;
use gridweave_runtime::ros::{DeformationNode, MapDeformation};
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new("map_placer", "bent_map", |log| {
            log.map(1.0, "robot1", &TestMap::room()).map(1.0, "robot2", &TestMap::room());
            log.map(1.0, "robot3", &TestMap::room());
            deformation(log, 2.0);
            place(log, 2.0, &placed(pose(5.0, 1.0, 0.3)));
        }),
        Case::new("map_placer", "absurd_frames", |log| {
            log.map(1.0, "robot1", &TestMap::room()).map(1.0, "robot2", &TestMap::room());
            place(log, 2.0, &placed(pose(f64::NAN, 1.0, 0.3)));
        }),
        Case::new("path_placer", "bent_map", |log| {
            drive(log, 0.0);
            deformation(log, 2.0);
            place(log, 2.0, &placed(pose(5.0, 1.0, 0.3)));
        }),
        Case::new("path_placer", "frames_that_change", |log| {
            drive(log, 0.0);
            place(log, 2.0, &placed(pose(5.0, 1.0, 0.3)));
            drive(log, 3.0);
            place(log, 5.0, &placed(pose(6.0, 1.0, 0.3)));
            log.uncertain_pose(6.0, "robot2", 0.0, 0.0, 0.0);
        }),
    ]
}

/// Both robots; the pose of robot3 is unknown.
fn placed(transform_1_2: Pose2) -> [(&'static str, Pose2); 2] {
    [("robot1", Pose2::identity()), ("robot2", transform_1_2)]
}

/// Three robots drive 1.92 m in steps of 3 cm.
fn drive(log: &mut LogBuilder, start: f64) {
    for step in 0..=64 {
        for robot in ["robot1", "robot2", "robot3"] {
            log.uncertain_pose(start + 0.01 * f64::from(step), robot, 1.0 + 0.03 * f64::from(step), 1.0, 0.0);
        }
    }
}

/// The map of robot2 is 20 cm longer along x than it should be over 8 m, and turned where y is great.
fn deformation(log: &mut LogBuilder, seconds: f64) {
    let node = |(column, row): (i32, i32)| DeformationNode {
        x: 4.0 * f64::from(column),
        y: 4.0 * f64::from(row),
        dx: -0.1 * f64::from(column),
        dyaw: 0.02 * f64::from(row),
        ..Default::default()
    };
    let vertices = (-1..=2).flat_map(|row| (-1..=2).map(move |column| (column, row)));
    let deformation = MapDeformation {
        header: header(seconds, "robot2/map"),
        robot: "robot2".into(),
        spacing: 4.0,
        nodes: vertices.map(node).collect(),
        ..Default::default()
    };
    log.message(seconds, "/robot2/elastic/deformation", &deformation);
}

//! Tags that a robot sees where its scans do not show how far it has come.

use super::test_drive::{at, cast};
use super::tests::Bench;
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::ros::{Header, PoseWithCovarianceStamped, RangeScan, TagPosition};
use std::f64::consts::TAU;

/// A bare corridor, whose ends the lidar does not reach.
const CORRIDOR: [[f64; 4]; 1] = [[-30.0, -1.0, 30.0, 1.0]];
const BEAMS: usize = 180;
/// Where the tag is.
const TAG: [f64; 2] = [1.0, 0.9];
/// Seconds of the way there, and of the way back.
const WAY: f64 = 20.0;

/// The way along the corridor at a time, metres.
fn way(seconds: f64) -> f64 {
    0.5 * (WAY - (seconds - WAY).abs())
}

fn scan(seconds: f64) -> RangeScan {
    let apart = TAU / BEAMS as f64;
    let from = pose(way(seconds), 0.0, 0.0);
    RangeScan {
        header: Header::new(at(seconds), "robot1/base_link"),
        angle_increment: apart,
        range_min: 0.05,
        range_max: 6.0,
        ranges: (0..BEAMS).map(|beam| cast(&CORRIDOR, &from, apart * beam as f64) as f32).collect(),
        ..Default::default()
    }
}

/// Where the robot is at the end by SLAM, along the corridor, metres. Its wheels go too far on the way there, and not far
/// enough on the way back. `tag` is what its camera calls the tag.
fn end(tag: Option<&str>) -> (f64, Vec<String>) {
    let mut bench = Bench::new("mode = 'offline'\nwait_for_poses = 0");
    let mut odometry = 0.0;
    for tick in 0..=(2.0 * WAY / 0.1) as usize {
        let seconds = 0.1 * tick as f64;
        let step = way(seconds) - way((seconds - 0.1).max(0.0));
        odometry += step * if step > 0.0 { 1.04 } else { 0.96 };
        bench.pose("odometry", "robot1/odom", seconds, pose(odometry, 0.0, 0.0));
        bench.scan(seconds, &scan(seconds));
        let seen = pose(way(seconds), 0.0, 0.0).inverse() * Point2::from(TAG);
        if let Some(tag) = tag.filter(|_| seen.coords.norm() < 2.0) {
            let header = Header::new(at(seconds), "robot1/base_link");
            let position = TagPosition { header, tag_id: tag.to_owned(), x: seen.x, y: seen.y, covariance: [0.0; 4] };
            bench.0.give::<TagPosition>("positions", "robot1", at(seconds), &position).unwrap();
        }
    }
    bench.0.finish(at(2.0 * WAY)).unwrap();
    let poses = bench.0.take_messages("pose");
    let last: PoseWithCovarianceStamped = poses.last().unwrap().decode().unwrap();
    let at_end: Pose2 = last.pose.pose.planar();
    (at_end.translation.x, bench.0.warnings().keys().cloned().collect())
}

#[test]
fn a_tag_that_is_seen_again_shows_how_far_a_robot_has_come_along_a_corridor() {
    let (without, _) = end(None);
    assert!(without > 0.5, "{without} m");
    let (with, warnings) = end(Some("family:7"));
    assert!(with.abs() < 0.2, "{with} m");
    assert_eq!(warnings, [""; 0]);
    let (nameless, warnings) = end(Some(""));
    assert_eq!(nameless, without);
    assert_eq!(warnings, ["tags of robot1 without id or position are left out"]);
}

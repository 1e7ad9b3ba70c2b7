//! Inputs of `scan_mapper`: robots that turn in a room.

use super::Case;
use gridweave_runtime::ros::{PoseStamped, PoseWithCovarianceStamped, RangeScan};
use gridweave_stages::shared::geometry::{Pose2, pose};
use gridweave_tests::{LogBuilder, header};
use std::f64::consts::TAU;

const BEAMS: usize = 90;
/// Seconds of a turn of the lidar.
const TURN: f64 = 0.1;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new("scan_mapper", "a_robot_that_turns", |log| drive(log, "pose", "robot1/map", 1.0)),
        // Wheels that are thought to be 4 % larger than they are.
        Case::new("scan_mapper", "odometry_alone", |log| drive(log, "odometry", "robot1/odom", 1.04)),
        Case::new("scan_mapper", "scans_alone", |log| {
            let odd = RangeScan { angle_increment: f64::NAN, ..scan(1.0) };
            log.message(1.0, "/robot1/scans", &odd);
            log.message(2.0, "/robot1/scans", &scan(2.0));
            log.raw(3.0, "/robot1/scans", "gridweave_msgs/msg/RangeScan", &[0, 1, 0, 0, 9]);
            log.message(30.0, "/robot1/scans", &RangeScan { ranges: Vec::new(), ..scan(30.0) });
        }),
    ]
}

/// Where the robot is in a room from (-3, -2) to (3, 2), in which its map has its origin.
fn place(seconds: f64) -> Pose2 {
    let angle = 0.6 * seconds;
    pose(1.5 * angle.cos(), angle.sin(), 1.2 * angle)
}

fn scan(seconds: f64) -> RangeScan {
    let range = |beam: usize| {
        let share = beam as f64 / BEAMS as f64;
        let lidar = place(seconds + TURN * share);
        let (sine, cosine) = (lidar.rotation.angle() + TAU * share).sin_cos();
        let along = |start: f64, end: f64, part: f64| ((end * part.signum() - start) / part).abs();
        along(lidar.translation.x, 3.0, cosine).min(along(lidar.translation.y, 2.0, sine)) as f32
    };
    RangeScan {
        header: header(seconds, "robot1/base_link"),
        angle_increment: TAU / BEAMS as f64,
        time_increment: TURN / BEAMS as f64,
        range_min: 0.1,
        range_max: 10.0,
        ranges: (0..BEAMS).map(range).collect(),
        ..Default::default()
    }
}

/// Six seconds with poses at 20 Hz and scans at 5 Hz.
fn drive(log: &mut LogBuilder, topic: &str, frame: &str, scale: f64) {
    for tick in 0..120 {
        let seconds = 1.0 + 0.05 * f64::from(tick);
        let at = place(seconds);
        let stretched = pose(scale * at.translation.x, scale * at.translation.y, at.rotation.angle());
        let stamped = PoseStamped { header: header(seconds, frame), pose: stretched.into() };
        log.message(seconds, &format!("/robot1/{topic}"), &PoseWithCovarianceStamped::from(stamped));
        if tick % 4 == 0 {
            log.message(seconds, "/robot1/scans", &scan(seconds));
        }
    }
}

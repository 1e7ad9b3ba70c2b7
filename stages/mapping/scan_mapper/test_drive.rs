//! A drive in a building whose walls are known, and the scans on its way.

use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, RangeScan};
use std::f64::consts::TAU;

/// Outer walls, and a box in the room: left, low, right, high, metres.
pub(super) const WALLS: [[f64; 4]; 2] = [[-4.0, -3.0, 6.0, 3.0], [1.5, -1.0, 2.5, 0.2]];
pub(super) const BEAMS: usize = 360;
/// Seconds of a turn of the lidar.
pub(super) const TURN: f64 = 0.1;
pub(super) const CELL: f64 = 0.05;
/// Where the lidar is mounted.
pub(super) const LIDAR: [f64; 3] = [0.15, -0.05, 0.4];

/// The nearest of the walls on a beam.
pub(super) fn cast(walls: &[[f64; 4]], from: &Pose2, angle: f64) -> f64 {
    let (sine, cosine) = (from.rotation.angle() + angle).sin_cos();
    let start = from.translation.vector;
    let mut nearest = f64::INFINITY;
    for &[left, low, right, high] in walls {
        for x in [left, right] {
            let (range, y) = ((x - start.x) / cosine, start.y + (x - start.x) / cosine * sine);
            if range > 0.0 && (low..=high).contains(&y) {
                nearest = nearest.min(range);
            }
        }
        for y in [low, high] {
            let (range, x) = ((y - start.y) / sine, start.x + (y - start.y) / sine * cosine);
            if range > 0.0 && (left..=right).contains(&x) {
                nearest = nearest.min(range);
            }
        }
    }
    nearest
}

/// How far a point is from the nearest wall.
pub(super) fn to_wall(point: &Point2) -> f64 {
    let of = |[left, low, right, high]: [f64; 4]| {
        let outside = (left - point.x).max(point.x - right).max(low - point.y).max(point.y - high);
        let beyond = |value: f64, low: f64, high: f64| (low - value).max(value - high).max(0.0);
        match outside > 0.0 {
            true => beyond(point.x, left, right).hypot(beyond(point.y, low, high)),
            false => -outside,
        }
    };
    WALLS.into_iter().map(of).fold(f64::INFINITY, f64::min)
}

/// A drive around the box in the room, with a turn on the way: the pose of the base at a time, in the frame of the
/// building.
pub(super) fn truth(seconds: f64) -> Pose2 {
    let angle = 0.2 * seconds;
    pose(2.0 - 3.0 * angle.cos(), 1.8 * angle.sin() - 0.3, 1.5 * (0.7 * seconds).sin() + angle)
}

pub(super) fn at(seconds: f64) -> LogTime {
    LogTime::MIN.plus_seconds(100.0 + seconds)
}

/// A scan that begins at a time, made while the robot drives.
pub(super) fn scan(seconds: f64) -> RangeScan {
    let [x, y, yaw] = LIDAR;
    let apart = TAU / BEAMS as f64;
    let range = |beam: usize| {
        let lidar = truth(seconds + TURN * beam as f64 / BEAMS as f64) * pose(x, y, yaw);
        cast(&WALLS, &lidar, -3.0 + apart * beam as f64) as f32
    };
    RangeScan {
        header: Header::new(at(seconds), "robot1/base_link"),
        x,
        y,
        yaw,
        angle_min: -3.0,
        angle_increment: apart,
        time_increment: TURN / BEAMS as f64,
        range_min: 0.05,
        range_max: 20.0,
        ranges: (0..BEAMS).map(range).collect(),
    }
}

/// The ranges of a scan that takes no time.
pub(super) fn still_ranges(seconds: f64) -> Vec<f32> {
    let [x, y, yaw] = LIDAR;
    let lidar = truth(seconds) * pose(x, y, yaw);
    (0..BEAMS).map(|beam| cast(&WALLS, &lidar, -3.0 + TAU / BEAMS as f64 * beam as f64) as f32).collect()
}

//! `sensor_msgs`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// `sensor_msgs/msg/LaserScan`: a scan of a lidar that rotates about its axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// When the first beam was sent, and the frame of the lidar.
    pub header: Header,
    /// The direction of the first beam, radians.
    pub angle_min: f32,
    /// The direction of the last beam, radians.
    pub angle_max: f32,
    /// The angle from one beam to the next, radians.
    pub angle_increment: f32,
    /// The time from one beam to the next, seconds; 0 if unknown.
    pub time_increment: f32,
    /// The time from one scan to the next, seconds.
    pub scan_time: f32,
    /// The minimum valid range, metres.
    pub range_min: f32,
    /// The maximum valid range, metres.
    pub range_max: f32,
    /// The measured ranges, metres.
    pub ranges: Vec<f32>,
    /// The intensities of the echoes, in a unit of the device; empty if the device provides none.
    pub intensities: Vec<f32>,
}

/// `sensor_msgs/msg/LaserEcho`: the echoes of one beam, the nearest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct LaserEcho {
    pub echoes: Vec<f32>,
}

/// `sensor_msgs/msg/MultiEchoLaserScan`: a [`LaserScan`] with several echoes per beam.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct MultiEchoLaserScan {
    pub header: Header,
    pub angle_min: f32,
    pub angle_max: f32,
    pub angle_increment: f32,
    pub time_increment: f32,
    pub scan_time: f32,
    pub range_min: f32,
    pub range_max: f32,
    pub ranges: Vec<LaserEcho>,
    pub intensities: Vec<LaserEcho>,
}

ros_messages!("sensor_msgs": LaserScan, LaserEcho, MultiEchoLaserScan);

//! `sensor_msgs`.

use super::{Header, RosMessage, ros_messages};
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

/// `sensor_msgs/msg/PointField`: where a value of a point is in its bytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointField {
    /// `x`, `y`, `z` (metres), `intensity` and so on.
    pub name: String,
    /// From the first byte of the point.
    pub offset: u32,
    /// The type of the value, such as [`Self::FLOAT32`].
    pub datatype: u8,
    /// The number of values.
    pub count: u32,
}

impl PointField {
    /// Four bytes.
    pub const UINT32: u8 = 6;
    /// Four bytes.
    pub const FLOAT32: u8 = 7;
    /// Eight bytes.
    pub const FLOAT64: u8 = 8;
}

/// `sensor_msgs/msg/PointCloud2`: points in the frame of a sensor, borrowed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud2<'a> {
    /// When the points were measured, and the frame of the sensor.
    pub header: Header,
    /// The number of rows; 1 if the points are in no order.
    pub height: u32,
    /// The number of points in a row.
    pub width: u32,
    /// The values of a point.
    pub fields: Vec<PointField>,
    /// Whether the bytes of a value begin with the most significant.
    pub is_bigendian: bool,
    /// The length of a point, bytes.
    pub point_step: u32,
    /// The length of a row, bytes.
    pub row_step: u32,
    /// The rows.
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
    /// Whether every point is valid.
    pub is_dense: bool,
}

impl RosMessage for PointCloud2<'_> {
    const NAME: &'static str = "sensor_msgs/msg/PointCloud2";
    type Borrowed<'a> = PointCloud2<'a>;
}

ros_messages!("sensor_msgs": PointField, LaserScan, LaserEcho, MultiEchoLaserScan);

//! The ROS 2 messages that stages exchange, and their encoding (CDR).
//!
//! The types mirror the `.msg` files field by field. Units are SI, angles are in radians, and the header names the
//! frame. [`OccupancyGrid`] and [`PointCloud2`] borrow their contents; the other types are small and own their data.

pub mod cell;
mod codec;
mod deformation;
mod geometry;
mod gridweave;
mod icp;
mod machine;
mod map_msgs;
mod nav;
mod sensor;
mod std_msgs;
mod tags;
mod topological;
mod truth;
mod visualization;

pub use codec::{DecodeError, EncodeError, decode, encode, encode_into};
pub use deformation::{DeformationNode, MapDeformation, Sharpness};
pub use geometry::{
    Point, Pose, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion, TFMessage, Transform,
    TransformStamped, Vector3,
};
pub use gridweave::{
    Alignment, Evidence, MapAgreement, MapDirection, RangeScan, RobotFrame, RobotFrames, RobotGroup, Segment, Segments,
    UnmergedRobot, Verdict, Verdicts,
};
pub use icp::IcpErrors;
pub use machine::{MachineStages, StageProgress};
pub use map_msgs::OccupancyGridUpdate;
pub use nav::{GridError, GridPrefix, MapMetaData, OccupancyGrid, Odometry, Path};
pub use sensor::{LaserEcho, LaserScan, MultiEchoLaserScan, PointCloud2, PointField};
pub use std_msgs::{Header, Time};
pub use tags::{CommonTag, CommonTags, TagBearing, TagEstimate, TagEstimates, TagPosition, TagRange};
pub use topological::{TopologicalMap, TopologicalNode, TopologicalPath, TopologyError};
pub use truth::{CommonPlace, SimulationTruth, TrueFrame, TrueTag};
pub use visualization::{ColorRGBA, CompressedImage, Duration, Marker, MarkerArray, MeshFile, UVCoordinate};

use serde::{Deserialize, Serialize};

/// A message type with a ROS 2 name.
pub trait RosMessage {
    /// The full name, such as `nav_msgs/msg/OccupancyGrid`.
    const NAME: &'static str;

    /// The decoded type: one that borrows from bytes with the lifetime `'a`, or this type itself.
    type Borrowed<'a>: Serialize + Deserialize<'a>;
}

/// Implements [`RosMessage`] for types that own all their data.
macro_rules! ros_messages {
    ($package:literal: $($type:ident),*) => {$(
        impl $crate::ros::RosMessage for $type {
            const NAME: &'static str = concat!($package, "/msg/", stringify!($type));
            type Borrowed<'a> = Self;
        }
    )*};
}
use ros_messages;

//! `gridweave_msgs`: what is true of a simulated world.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// Where a simulated robot's map lies in truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrueFrame {
    /// Whose map.
    pub robot: String,
    /// Metres in the first robot's map frame.
    pub x: f64,
    /// Metres in the first robot's map frame.
    pub y: f64,
    /// Radians.
    pub yaw: f64,
    /// The middle of the robot's last map, in its map frame, metres.
    pub centre: [f64; 2],
}

/// Where a simulated tag is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrueTag {
    /// Which tag.
    pub tag_id: String,
    /// Metres in the first robot's map frame.
    pub x: f64,
    /// Metres in the first robot's map frame.
    pub y: f64,
}

/// What is true of a simulated world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SimulationTruth {
    /// Time, and the first robot's map frame.
    pub header: Header,
    /// Metres a cell of the first robot's map.
    pub resolution: f64,
    /// The robots, by name.
    pub frames: Vec<TrueFrame>,
    /// The tags, by id.
    pub tags: Vec<TrueTag>,
    /// Places that the first two robots by name both have driven through.
    pub common: Vec<CommonPlace>,
}

/// A place as the maps of two robots show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CommonPlace {
    /// x and y in the map frame of the first robot, metres.
    pub first: [f64; 2],
    /// x and y in the map frame of the second robot, metres.
    pub second: [f64; 2],
}

ros_messages!("gridweave_msgs": SimulationTruth);

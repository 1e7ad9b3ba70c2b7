//! `gridweave_msgs`: the ground truth of a simulated world.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// The true pose of a simulated robot's map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrueFrame {
    /// The robot of the map.
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

/// The true position of a simulated tag.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrueTag {
    /// The id of the tag.
    pub tag_id: String,
    /// Metres in the first robot's map frame.
    pub x: f64,
    /// Metres in the first robot's map frame.
    pub y: f64,
}

/// The ground truth of a simulated world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SimulationTruth {
    /// Time, and the first robot's map frame.
    pub header: Header,
    /// The resolution of the first robot's map, metres per cell.
    pub resolution: f64,
    /// The robots, by name.
    pub frames: Vec<TrueFrame>,
    /// The tags, by id.
    pub tags: Vec<TrueTag>,
    /// Positions that both of the first two robots by name have driven through.
    pub common: Vec<CommonPlace>,
}

/// A position in the maps of two robots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CommonPlace {
    /// x and y in the map frame of the first robot, metres.
    pub first: [f64; 2],
    /// x and y in the map frame of the second robot, metres.
    pub second: [f64; 2],
}

ros_messages!("gridweave_msgs": SimulationTruth);

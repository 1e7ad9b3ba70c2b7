//! `gridweave_msgs`, the part that describes a map by its places and the ways between them.

use super::{Header, Point, ros_messages};
use serde::{Deserialize, Serialize};

/// A place of a topological map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalNode {
    /// Metres, map frame.
    pub x: f64,
    /// Metres, map frame.
    pub y: f64,
    /// What it is: `end`, `junction`, `door`, `loop`, or what its maker calls it.
    pub kind: String,
    /// That it really is one, 0 to 1; 1 where nothing is known of it.
    pub probability: f64,
}

/// A way between two places of a topological map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalPath {
    /// The place of its first node in the list of nodes.
    pub start: u32,
    /// The place of its last node in the list of nodes.
    pub end: u32,
    /// Metres.
    pub length: f64,
    /// That it really is there, 0 to 1; 1 where nothing is known of it.
    pub probability: f64,
    /// What it passes through, from the first node to the last, both of them among these; metres, map frame.
    pub points: Vec<Point>,
}

/// The places of a map and the ways between them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalMap {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// Whose map.
    pub robot: String,
    /// The places.
    pub nodes: Vec<TopologicalNode>,
    /// The ways between them.
    pub paths: Vec<TopologicalPath>,
}

ros_messages!("gridweave_msgs": TopologicalMap);

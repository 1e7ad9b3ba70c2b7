//! `gridweave_msgs`: topological maps.

use super::{Header, Point, ros_messages};
use serde::{Deserialize, Serialize};

/// A node of a topological map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalNode {
    /// Metres, map frame.
    pub x: f64,
    /// Metres, map frame.
    pub y: f64,
    /// Its kind: `end`, `junction`, `door`, `loop`, or another one of its producer.
    pub kind: String,
    /// The probability that it exists, 0 to 1; 1 if unknown.
    pub probability: f64,
}

/// An edge between two nodes of a topological map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalPath {
    /// The index of its first node in the list of nodes.
    pub start: u32,
    /// The index of its last node in the list of nodes.
    pub end: u32,
    /// Its length, metres.
    pub length: f64,
    /// The probability that it exists, 0 to 1; 1 if unknown.
    pub probability: f64,
    /// Its course from the first node to the last, including both; metres, map frame.
    pub points: Vec<Point>,
}

/// The topological map of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TopologicalMap {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// The robot of the map.
    pub robot: String,
    /// The nodes.
    pub nodes: Vec<TopologicalNode>,
    /// The edges.
    pub paths: Vec<TopologicalPath>,
}

ros_messages!("gridweave_msgs": TopologicalMap);

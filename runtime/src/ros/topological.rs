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

/// The largest coordinate, metres: farther than any place on Earth, in any of the usual grids. Beyond, distances lose
/// their digits.
const FARTHEST: f64 = 1e8;

impl TopologicalMap {
    /// Checks that the message can be used as a topological map.
    ///
    /// # Errors
    /// The first value that cannot be.
    pub fn check(&self) -> Result<(), TopologyError> {
        let is_place = |x: f64, y: f64| x.abs() <= FARTHEST && y.abs() <= FARTHEST;
        let is_probability = |value: f64| (0.0..=1.0).contains(&value);
        for (number, node) in self.nodes.iter().enumerate() {
            if !is_place(node.x, node.y) {
                return Err(TopologyError::Position(number));
            }
            if !is_probability(node.probability) {
                return Err(TopologyError::NodeProbability(number));
            }
        }
        let nodes = self.nodes.len();
        for (number, path) in self.paths.iter().enumerate() {
            if let Some(node) = [path.start, path.end].into_iter().find(|node| *node as usize >= nodes) {
                return Err(TopologyError::NoSuchNode { path: number, node, nodes });
            }
            if !path.points.iter().all(|point| is_place(point.x, point.y)) {
                return Err(TopologyError::Point(number));
            }
            if !(path.length >= 0.0 && path.length.is_finite()) {
                return Err(TopologyError::Length(number));
            }
            if !is_probability(path.probability) {
                return Err(TopologyError::PathProbability(number));
            }
        }
        Ok(())
    }
}

/// Why a message cannot be used as a topological map. Nodes and paths are given by their index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyError {
    /// The position of a node is not finite, or is too far away.
    #[error("the position of node {0} is not finite, or farther than 10^8 m from the origin")]
    Position(usize),
    /// The probability of a node is none.
    #[error("the probability of node {0} is not between 0 and 1")]
    NodeProbability(usize),
    /// A path to a node that does not exist.
    #[error("path {path} has node {node}, but there are only {nodes}, counted from 0")]
    NoSuchNode {
        /// Index of the path.
        path: usize,
        /// The node of the path.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A point of a path is not finite, or is too far away.
    #[error("a point of path {0} is not finite, or farther than 10^8 m from the origin")]
    Point(usize),
    /// The length of a path is none.
    #[error("the length of path {0} is not a number from 0 up")]
    Length(usize),
    /// The probability of a path is none.
    #[error("the probability of path {0} is not between 0 and 1")]
    PathProbability(usize),
}

ros_messages!("gridweave_msgs": TopologicalMap);

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(change: impl Fn(&mut TopologicalMap)) -> Result<(), TopologyError> {
        let node = |x| TopologicalNode { x, probability: 1.0, ..Default::default() };
        let points = vec![Point::default(), Point { x: 3.0, ..Default::default() }];
        let path = TopologicalPath { start: 0, end: 1, length: 3.0, probability: 1.0, points };
        let mut map = TopologicalMap { nodes: vec![node(0.0), node(3.0)], paths: vec![path], ..Default::default() };
        change(&mut map);
        map.check()
    }

    #[test]
    fn a_topological_map_with_a_value_out_of_range_is_refused() {
        assert_eq!(checked(|_| ()), Ok(()));
        for (value, other) in [(f64::NAN, f64::INFINITY), (-1e300, 1e9)] {
            assert_eq!(checked(|map| map.nodes[1].y = value), Err(TopologyError::Position(1)));
            assert_eq!(checked(|map| map.nodes[0].x = other), Err(TopologyError::Position(0)));
            assert_eq!(checked(|map| map.paths[0].points[1].x = value), Err(TopologyError::Point(0)));
        }
        for value in [f64::NAN, -0.1, 1.5] {
            assert_eq!(checked(|map| map.nodes[1].probability = value), Err(TopologyError::NodeProbability(1)));
            assert_eq!(checked(|map| map.paths[0].probability = value), Err(TopologyError::PathProbability(0)));
        }
        for value in [f64::NAN, -0.1, f64::INFINITY] {
            assert_eq!(checked(|map| map.paths[0].length = value), Err(TopologyError::Length(0)));
        }
        let missing = TopologyError::NoSuchNode { path: 0, node: 2, nodes: 2 };
        assert_eq!(checked(|map| map.paths[0].end = 2), Err(missing));
    }
}

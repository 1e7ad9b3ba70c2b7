//! A topological map as points.

use crate::shared::geometry::Point2;
use gridweave_runtime::ros::TopologicalMap;
use std::collections::BTreeSet;

/// The nodes of a topological map and the straight paths between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Positions of the nodes in the map frame, metres.
    pub nodes: Vec<Point2>,
    /// Each by the numbers of its two nodes. Paths between the same two are one: they are compared by their ends.
    pub paths: Vec<[usize; 2]>,
}

/// Why a message cannot be used as a topological map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyError {
    /// A position is not finite.
    #[error("the position of node {0} is not finite")]
    Position(usize),
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
}

impl Topology {
    /// The nodes and paths of a message.
    ///
    /// # Errors
    /// A position is not finite, or a path has a node that does not exist.
    pub fn from_message(map: &TopologicalMap) -> Result<Self, TopologyError> {
        let nodes: Vec<Point2> = map.nodes.iter().map(|node| Point2::new(node.x, node.y)).collect();
        if let Some(node) = nodes.iter().position(|node| !(node.x.is_finite() && node.y.is_finite())) {
            return Err(TopologyError::Position(node));
        }
        let mut paths = Vec::with_capacity(map.paths.len());
        for (path, ends) in map.paths.iter().map(|path| [path.start, path.end]).enumerate() {
            if let Some(&node) = ends.iter().find(|node| **node as usize >= nodes.len()) {
                return Err(TopologyError::NoSuchNode { path, node, nodes: nodes.len() });
            }
            paths.push(ends.map(|node| node as usize));
        }
        let mut known = BTreeSet::new();
        paths.retain(|&[start, end]| known.insert([start.min(end), start.max(end)]));
        Ok(Self { nodes, paths })
    }

    /// The paths that are distinguished from others by their ends: those longer than twice the tolerance from end to
    /// end.
    pub(super) fn long_paths(&self, tolerance: f64) -> impl Iterator<Item = [usize; 2]> {
        let is_long = move |ends: &[usize; 2]| (self.nodes[ends[0]] - self.nodes[ends[1]]).norm() > 2.0 * tolerance;
        self.paths.iter().copied().filter(is_long)
    }

    /// The mean of the nodes.
    pub(super) fn centre(&self) -> Point2 {
        let share = 1.0 / self.nodes.len().max(1) as f64;
        self.nodes.iter().fold(Point2::origin(), |sum, node| sum + node.coords * share)
    }
}

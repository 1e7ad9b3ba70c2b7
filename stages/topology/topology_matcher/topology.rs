//! A topological map as points.

use crate::shared::geometry::Point2;
use gridweave_runtime::ros::{TopologicalMap, TopologyError};
use std::collections::BTreeSet;

/// The nodes of a topological map and the straight paths between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Positions of the nodes in the map frame, metres.
    pub nodes: Vec<Point2>,
    /// Each by the numbers of its two nodes. Paths between the same two are one: they are compared by their ends.
    pub paths: Vec<[usize; 2]>,
}

impl Topology {
    /// The nodes and paths of a message.
    ///
    /// # Errors
    /// A value is out of range, or a path has a node that does not exist.
    pub fn from_message(map: &TopologicalMap) -> Result<Self, TopologyError> {
        map.check()?;
        let nodes = map.nodes.iter().map(|node| Point2::new(node.x, node.y)).collect();
        let ends = map.paths.iter().map(|path| [path.start, path.end].map(|node| node as usize));
        let mut paths: Vec<[usize; 2]> = ends.collect();
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

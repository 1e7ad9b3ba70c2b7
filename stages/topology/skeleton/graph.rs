//! A skeleton as a graph.

use super::trace::trace;
use super::{DistanceMap, Skeleton};
use crate::shared::geometry::Cell;

/// Kind of a node of a skeleton.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// An end of a path; or an isolated point.
    End,
    /// A junction of three paths or more.
    Junction,
    /// The widest point of a closed path that meets no other.
    Loop,
}

/// A node of a skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonNode {
    /// Position; of a junction of several cells, the one that is farthest from obstacles.
    pub cell: Cell,
    /// Kind of the node.
    pub kind: NodeKind,
    /// Distance to the nearest cell that is not free, metres.
    pub clearance: f64,
}

/// A path between two nodes of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonPath {
    /// Indices of its first and last node in [`SkeletonGraph::nodes`].
    pub nodes: [usize; 2],
    /// Cells from the first node to the last, including both. Neighbours in this list are neighbours on the grid,
    /// except at junctions of several cells, of which only one is listed.
    pub cells: Vec<Cell>,
    /// Length, metres. The steps of the grid are smoothed.
    pub length: f64,
}

/// The ends and junctions of a skeleton, and the paths between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkeletonGraph {
    /// Row by row.
    pub nodes: Vec<SkeletonNode>,
    /// In the order of their first nodes.
    pub paths: Vec<SkeletonPath>,
}

/// Number of cells from one end of a chord to the other when the length of a path is measured.
const CHORD: usize = 5;

impl SkeletonGraph {
    /// Graph of a skeleton with its distances.
    pub fn of(skeleton: &Skeleton, distances: &DistanceMap) -> Self {
        let (window, traced) = (&skeleton.window, trace(skeleton, distances));
        let nodes = traced.nodes.iter().map(|&(place, kind)| SkeletonNode {
            cell: window.cell(place),
            kind,
            clearance: distances.at(place),
        });
        let paths = traced.paths.iter().map(|(nodes, places)| {
            let cells: Vec<Cell> = places.iter().map(|place| window.cell(*place)).collect();
            SkeletonPath { nodes: *nodes, length: way_length(&cells, window.geometry.resolution), cells }
        });
        Self { nodes: nodes.collect(), paths: paths.collect() }
    }
}

/// Length of a path through cells of `resolution` metres, by chords: cell by cell, slanted paths would be too long.
pub fn way_length(cells: &[Cell], resolution: f64) -> f64 {
    let chosen = (0..cells.len()).step_by(CHORD).chain(cells.len().checked_sub(1));
    let chosen: Vec<Cell> = chosen.map(|place| cells[place]).collect();
    let chord = |pair: &[Cell]| {
        let apart = |one: usize, other: usize| one.abs_diff(other) as f64;
        apart(pair[0].column, pair[1].column).hypot(apart(pair[0].row, pair[1].row))
    };
    chosen.windows(2).map(chord).sum::<f64>() * resolution
}

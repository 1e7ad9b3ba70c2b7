//! A skeleton as a graph.

use super::trace::trace;
use super::{DistanceMap, Skeleton};
use crate::shared::geometry::Cell;

/// What a node of a skeleton is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// A way ends here; or it is a place from which no way leads.
    End,
    /// Three ways or more meet.
    Junction,
    /// A place of a way that leads back to itself and meets no other: where it is widest.
    Loop,
}

/// A node of a skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonNode {
    /// Where it is; of a junction of several cells, the one that is farthest from obstacles.
    pub cell: Cell,
    /// What it is.
    pub kind: NodeKind,
    /// The distance to the nearest cell that is not free, metres.
    pub clearance: f64,
}

/// A way between two nodes of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonPath {
    /// The places of its first and last node in [`SkeletonGraph::nodes`].
    pub nodes: [usize; 2],
    /// The cells that it passes through from the first node to the last, both of them among these. Neighbours in this list
    /// are neighbours on the grid, but for junctions of several cells, of which only one is named.
    pub cells: Vec<Cell>,
    /// Metres. The steps of the grid are smoothed out.
    pub length: f64,
}

/// The ends and junctions of a skeleton, and the ways between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkeletonGraph {
    /// Row by row as they were found.
    pub nodes: Vec<SkeletonNode>,
    /// In the order of their first nodes.
    pub paths: Vec<SkeletonPath>,
}

/// The length of a way through cells is measured from each to the one that comes so many later.
const CHORD: usize = 5;

impl SkeletonGraph {
    /// The graph of a skeleton, which was made from these distances.
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

/// The length of a way through cells of `resolution` metres, by chords: cell by cell, slanted ways would come out too long.
pub fn way_length(cells: &[Cell], resolution: f64) -> f64 {
    let chosen = (0..cells.len()).step_by(CHORD).chain(cells.len().checked_sub(1));
    let chosen: Vec<Cell> = chosen.map(|place| cells[place]).collect();
    let chord = |pair: &[Cell]| {
        let apart = |one: usize, other: usize| one.abs_diff(other) as f64;
        apart(pair[0].column, pair[1].column).hypot(apart(pair[0].row, pair[1].row))
    };
    chosen.windows(2).map(chord).sum::<f64>() * resolution
}

//! Extracts the nodes and paths of an occupancy grid.

use super::{TopologyExtractorParameters, doors, simplify};
use crate::shared::geometry::{Cell, Grid, Point2};
use crate::topology::skeleton::{DistanceMap, NodeKind, SkeletonGraph, SkeletonPath, skeleton_graph, way_length};
use gridweave_runtime::ros::{Point, TopologicalNode, TopologicalPath};

/// Nodes of a map and the paths between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExtractedTopology {
    /// Ends, junctions and loops of the skeleton, and then doors.
    pub nodes: Vec<TopologicalNode>,
    /// Each by few points: the others are at most a cell away from their straight connections.
    pub paths: Vec<TopologicalPath>,
}

/// Extracts the nodes of a map and the paths between them. An empty map has none.
pub fn extract(grid: &Grid<'_>, parameters: &TopologyExtractorParameters) -> ExtractedTopology {
    let Some((graph, distances)) = skeleton_graph(grid, &parameters.skeleton()) else {
        return ExtractedTopology::default();
    };
    let is_kept = kept_nodes(&graph, parameters.min_piece);
    let mut topology = ExtractedTopology::default();
    let mut numbers = Vec::with_capacity(graph.nodes.len());
    for (node, is_kept) in graph.nodes.iter().zip(&is_kept) {
        numbers.push(topology.nodes.len() as u32);
        if *is_kept {
            topology.add_node(grid, node.cell, name(node.kind));
        }
    }
    for path in graph.paths.iter().filter(|path| is_kept[path.nodes[0]]) {
        topology.add_way(grid, path, path.nodes.map(|node| numbers[node]), &distances, parameters);
    }
    topology
}

fn name(kind: NodeKind) -> &'static str {
    match kind {
        NodeKind::End => "end",
        NodeKind::Junction => "junction",
        NodeKind::Loop => "loop",
    }
}

/// Which nodes belong to a piece of the graph that is large enough.
fn kept_nodes(graph: &SkeletonGraph, min_piece: f64) -> Vec<bool> {
    let mut pieces: Vec<usize> = (0..graph.nodes.len()).collect();
    fn root(pieces: &[usize], mut node: usize) -> usize {
        while pieces[node] != node {
            node = pieces[node];
        }
        node
    }
    for path in &graph.paths {
        let [one, other] = path.nodes.map(|node| root(&pieces, node));
        pieces[one.max(other)] = one.min(other);
    }
    let (mut ways, mut widths) = (vec![0.0; pieces.len()], vec![0.0f64; pieces.len()]);
    for (node, at) in graph.nodes.iter().enumerate() {
        let piece = root(&pieces, node);
        widths[piece] = widths[piece].max(2.0 * at.clearance);
    }
    graph.paths.iter().for_each(|path| ways[root(&pieces, path.nodes[0])] += path.length);
    let is_large = |node: usize| ways[root(&pieces, node)] + widths[root(&pieces, node)] >= min_piece;
    (0..pieces.len()).map(is_large).collect()
}

impl ExtractedTopology {
    fn add_node(&mut self, grid: &Grid<'_>, cell: Cell, kind: &str) -> u32 {
        let Point2 { coords } = grid.geometry.centre(cell);
        self.nodes.push(TopologicalNode { x: coords.x, y: coords.y, kind: kind.into(), probability: 1.0 });
        self.nodes.len() as u32 - 1
    }

    /// Adds the path between two nodes, split at its doors.
    fn add_way(
        &mut self,
        grid: &Grid<'_>,
        path: &SkeletonPath,
        [mut start, end]: [u32; 2],
        distances: &DistanceMap,
        parameters: &TopologyExtractorParameters,
    ) {
        let clearances: Vec<f64> = path.cells.iter().map(|cell| distances.distance(*cell)).collect();
        let mut first = 0;
        for door in doors(&clearances, parameters.max_door_width, parameters.door_widening) {
            let node = self.add_node(grid, path.cells[door], "door");
            self.add_path(grid, &path.cells[first..=door], start, node);
            (first, start) = (door, node);
        }
        self.add_path(grid, &path.cells[first..], start, end);
    }

    fn add_path(&mut self, grid: &Grid<'_>, cells: &[Cell], start: u32, end: u32) {
        let centres: Vec<Point2> = cells.iter().map(|cell| grid.geometry.centre(*cell)).collect();
        let points = simplify(&centres, grid.geometry.resolution);
        self.paths.push(TopologicalPath {
            start,
            end,
            length: way_length(cells, grid.geometry.resolution),
            probability: 1.0,
            points: points.iter().map(|point| Point { x: point.x, y: point.y, z: 0.0 }).collect(),
        });
    }
}

//! The stage: computes the diagram of every map that differs from the robot's last.

use super::{PgvdExtractorParameters, point_probability};
use gridweave_runtime::ros::{Header, OccupancyGrid, Point, TopologicalMap, TopologicalNode, TopologicalPath};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::shared::geometry::{Cell, Grid};
use gridweave_stages::shared::robot_maps::RobotMaps;
use gridweave_stages::topology::skeleton::{NodeKind, skeleton_graph};
use rayon::prelude::*;

/// Outputs of the stage.
pub(super) struct Diagrams {
    topological_map: Out<TopologicalMap>,
}

impl Outputs for Diagrams {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "The diagram of each map that has changed: its ends and junctions, and the paths between them, with their \
                       probabilities.";
        Self { topological_map: ports.output("topological_map", summary) }
    }
}

/// Makes the diagrams of robots' maps.
pub(super) struct PgvdExtractor {
    parameters: PgvdExtractorParameters,
    maps: RobotMaps<()>,
}

impl PgvdExtractor {
    pub(super) fn new(parameters: PgvdExtractorParameters) -> Self {
        Self { parameters, maps: RobotMaps::default() }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Diagrams>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        let is_same = self.maps.get(robot).is_some_and(|before| before.is_same(&map));
        if is_same || !self.maps.keep(&map, output, |_| ()) {
            return Ok(());
        }
        let Some(kept) = self.maps.get(robot) else { return Ok(()) };
        let diagram = topological_map(&kept.grid(), &self.parameters);
        let header = Header::new(output.log_time(), kept.frame_id.clone());
        output.topological_map.send(robot, &TopologicalMap { header, robot: robot.to_owned(), ..diagram })
    }
}

/// Diagram of a map, in its frame, without header and robot. Nodes and paths are those of its skeleton; none if no
/// free space is wide enough.
pub fn topological_map(grid: &Grid<'_>, parameters: &PgvdExtractorParameters) -> TopologicalMap {
    let Some((graph, distances)) = skeleton_graph(grid, &parameters.skeleton()) else {
        return TopologicalMap::default();
    };
    let probability = |cell: &Cell| point_probability(grid, *cell, distances.distance(*cell));
    let node = |node: &gridweave_stages::topology::skeleton::SkeletonNode| {
        let place = grid.geometry.centre(node.cell);
        let kind = match node.kind {
            NodeKind::End => "end",
            NodeKind::Junction => "junction",
            NodeKind::Loop => "loop",
        };
        TopologicalNode { x: place.x, y: place.y, kind: kind.into(), probability: probability(&node.cell) }
    };
    let path = |path: &gridweave_stages::topology::skeleton::SkeletonPath| {
        let sum: f64 = path.cells.iter().map(probability).sum();
        let point = |cell: &Cell| {
            let place = grid.geometry.centre(*cell);
            Point { x: place.x, y: place.y, z: 0.0 }
        };
        TopologicalPath {
            start: path.nodes[0] as u32,
            end: path.nodes[1] as u32,
            length: path.length,
            probability: sum / path.cells.len().max(1) as f64,
            points: path.cells.iter().map(point).collect(),
        }
    };
    let paths: Vec<TopologicalPath> = graph.paths.par_iter().map(path).collect();
    TopologicalMap {
        nodes: graph.nodes.iter().map(node).collect(),
        paths: paths.into_iter().filter(|path| path.probability >= parameters.min_probability).collect(),
        ..TopologicalMap::default()
    }
}

//! The stage: a topological map for every map.

use super::{ExtractedTopology, TopologyExtractorParameters, extract};
use crate::shared::geometry::Grid;
use gridweave_runtime::ros::{OccupancyGrid, TopologicalMap};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};

/// Outputs of the stage.
pub(super) struct TopologicalMaps {
    topology: Out<TopologicalMap>,
}

impl Outputs for TopologicalMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { topology: ports.output("topology", "The nodes of each map and the paths between them.") }
    }
}

/// Extracts topological maps from the maps of robots.
pub(super) struct TopologyExtractor {
    pub(super) parameters: TopologyExtractorParameters,
}

impl TopologyExtractor {
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<TopologicalMaps>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        let grid = match Grid::from_message(&map) {
            Ok(grid) => grid,
            Err(problem) => {
                output.warn(format!("a map of {robot} was left out: {problem}"));
                return Ok(());
            }
        };
        let ExtractedTopology { nodes, paths } = extract(&grid, &self.parameters);
        output.topology.send(robot, &TopologicalMap { header: map.header.clone(), robot: robot.into(), nodes, paths })
    }
}

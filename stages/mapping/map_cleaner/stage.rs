//! The stage: cleans every map.

use super::{MapCleanerParameters, clean};
use crate::shared::geometry::Grid;
use gridweave_runtime::ros::{GridPrefix, OccupancyGrid};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};

/// Outputs of the stage.
pub(super) struct CleanedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for CleanedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { map: ports.output("map", "The robots' maps, reduced to walls and the space between them.") }
    }
}

/// Cleans the maps of robots.
pub(super) struct MapCleaner {
    pub(super) parameters: MapCleanerParameters,
}

impl MapCleaner {
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<CleanedMaps>,
    ) -> Result<(), StageError> {
        let grid = match Grid::from_message(&map) {
            Ok(grid) => grid,
            Err(problem) => {
                output.warn(format!("a map of {} was left out: {problem}", map.robot()));
                return Ok(());
            }
        };
        let prefix = GridPrefix { header: map.header.clone(), info: map.info };
        output.map.send_grid(map.robot(), &prefix, |blank| {
            let mut filled = blank.copy_cells(grid.cells)?;
            clean(&grid, &self.parameters, filled.cells_mut());
            Ok(filled)
        })
    }
}

//! The stage: cleans every map.

use super::{MapCleanerParameters, SheetFrame, clean, frame_of_sheet};
use crate::shared::geometry::{Grid, UNKNOWN};
use gridweave_runtime::ros::{GridPrefix, OccupancyGrid};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeMap;

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
    parameters: MapCleanerParameters,
    /// Sizes of the frames that are kept, of robots' maps that are drawn sheets: width and height, metres.
    frames: BTreeMap<String, [f64; 2]>,
}

impl MapCleaner {
    pub(super) fn new(parameters: MapCleanerParameters) -> Self {
        Self { parameters, frames: BTreeMap::new() }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<CleanedMaps>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        let grid = match Grid::from_message(&map) {
            Ok(grid) => grid,
            Err(problem) => {
                output.warn(format!("a map of {robot} was left out: {problem}"));
                return Ok(());
            }
        };
        let frame = self.repeated_frame(robot, &grid);
        if let Some((other, _)) = &frame {
            output.warn(format!(
                "the maps of {other} and {robot} are drawings in frames of one size: the frame of {robot}, and what is \
                 connected with it, is not compared with other maps"
            ));
        }
        let prefix = GridPrefix { header: map.header.clone(), info: map.info };
        output.map.send_grid(robot, &prefix, |blank| {
            let mut filled = blank.copy_cells(grid.cells)?;
            clean(&grid, &self.parameters, filled.cells_mut());
            if let Some((_, frame)) = &frame {
                frame.cells.iter().for_each(|place| filled.cells_mut()[*place] = UNKNOWN);
            }
            Ok(filled)
        })
    }

    /// The frame of a robot's map that is a drawn sheet, if the map of another robot has one of that size, with the name
    /// of that robot.
    fn repeated_frame(&mut self, robot: &str, grid: &Grid<'_>) -> Option<(String, SheetFrame)> {
        self.frames.remove(robot);
        let frame = frame_of_sheet(grid)?;
        if let Some((other, _)) = self.frames.iter().find(|(_, size)| frame.is_as_large(size)) {
            return Some((other.clone(), frame));
        }
        self.frames.insert(robot.to_owned(), frame.size);
        None
    }
}

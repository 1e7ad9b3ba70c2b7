//! The stage: keeps for each robot the latest map and the one that was passed on last.

use super::{MapSelectorParameters, changed_cells, known_cells};
use crate::shared::geometry::Grid;
use crate::shared::robot_maps::{RobotMap, RobotMaps};
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeSet;

/// Outputs of the stage.
pub(super) struct SelectedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for SelectedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { map: ports.output("map", "The robots' maps that differ enough from the one before, unchanged.") }
    }
}

/// Selects the maps of robots.
pub(super) struct MapSelector {
    parameters: MapSelectorParameters,
    last: RobotMaps<()>,
    /// Each with the number of its known cells.
    passed_on: RobotMaps<usize>,
    /// The robots whose last map was not passed on.
    waiting: BTreeSet<String>,
}

impl MapSelector {
    pub(super) fn new(parameters: MapSelectorParameters) -> Self {
        Self { parameters, last: RobotMaps::default(), passed_on: RobotMaps::default(), waiting: BTreeSet::new() }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<SelectedMaps>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        if !self.last.keep(&map, output, |_| ()) {
            // That the robot exists must be known, to report that it is not merged.
            return output.map.send_bytes(robot, map.message().bytes());
        }
        let before = self.passed_on.get(robot).zip(self.last.get(robot));
        let has_changed = before.is_none_or(|(before, last)| self.has_changed(before, &last.grid()));
        if !has_changed {
            self.waiting.insert(robot.to_owned());
            return Ok(());
        }
        self.waiting.remove(robot);
        self.passed_on.keep(&map, output, |grid| known_cells(grid.cells));
        output.map.send_bytes(robot, map.message().bytes())
    }

    /// Whether a map has changed enough to be passed on.
    fn has_changed(&self, before: &RobotMap<usize>, map: &Grid<'_>) -> bool {
        let changed = changed_cells(&before.grid(), map);
        changed.is_none_or(|changed| {
            changed as f64 >= self.parameters.min_change * before.own as f64
                && (changed > 0 || self.parameters.min_change == 0.0)
        })
    }

    /// The last maps are those of the final merge.
    pub(super) fn finish(&mut self, output: &Output<SelectedMaps>) -> Result<(), StageError> {
        let last = self.waiting.iter().filter_map(|robot| Some((robot, self.last.get(robot)?)));
        last.into_iter().try_for_each(|(robot, map)| output.map.send_bytes(robot, map.bytes()))
    }
}

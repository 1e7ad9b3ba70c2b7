//! The stage: keeps of each robot the map that came last and the one that was passed on last.

use super::{MapSelectorParameters, changed_share};
use crate::robot_maps::RobotMaps;
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeSet;

/// What the stage sends.
pub(super) struct SelectedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for SelectedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { map: ports.output("map", "Those of the robots' maps that tell something, as they came.") }
    }
}

/// Picks the maps of robots.
pub(super) struct MapSelector {
    parameters: MapSelectorParameters,
    last: RobotMaps<()>,
    passed_on: RobotMaps<()>,
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
            return Ok(());
        }
        let before = self.passed_on.get(robot).zip(self.last.get(robot));
        let has_changed = before
            .is_none_or(|(before, last)| changed_share(&before.grid(), &last.grid()) >= self.parameters.min_change);
        if !has_changed {
            self.waiting.insert(robot.to_owned());
            return Ok(());
        }
        self.waiting.remove(robot);
        self.passed_on.keep(&map, output, |_| ());
        output.map.send_bytes(robot, map.message().bytes())
    }

    /// The last maps are those that a merge is judged by.
    pub(super) fn finish(&mut self, output: &Output<SelectedMaps>) -> Result<(), StageError> {
        let last = self.waiting.iter().filter_map(|robot| Some((robot, self.last.get(robot)?)));
        last.into_iter().try_for_each(|(robot, map)| output.map.send_bytes(robot, map.bytes()))
    }
}

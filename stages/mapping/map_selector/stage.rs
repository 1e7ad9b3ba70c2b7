//! The stage: keeps for each robot the latest map and the one that was passed on last.

use super::{MapSelectorParameters, changed_cells, known_cells};
use crate::shared::geometry::Grid;
use crate::shared::robot_maps::{RobotMap, RobotMaps};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::{BTreeMap, BTreeSet};

/// Outputs of the stage.
pub(super) struct SelectedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for SelectedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { map: ports.output("map", "The robots' maps that differ enough from the one before, unchanged.") }
    }
}

/// The map of a robot with the largest known area.
#[derive(Clone, Copy)]
struct LargestMap {
    /// Square metres.
    area: f64,
    received: LogTime,
}

/// A map with less than this share of the known area of an earlier one is another map: the closing of loops makes maps
/// smaller, and not by so much.
const LEAST_SHARE: f64 = 0.5;

/// The known area of a map, square metres.
fn known_area(map: &RobotMap<usize>) -> f64 {
    map.own as f64 * map.grid().geometry.resolution.powi(2)
}

/// Selects the maps of robots.
pub(super) struct MapSelector {
    parameters: MapSelectorParameters,
    /// Each with the number of its known cells.
    last: RobotMaps<usize>,
    /// The robots' largest maps so far.
    largest: BTreeMap<String, LargestMap>,
    /// Each with the number of its known cells.
    passed_on: RobotMaps<usize>,
    /// The robots whose last map was not passed on.
    waiting: BTreeSet<String>,
}

impl MapSelector {
    pub(super) fn new(parameters: MapSelectorParameters) -> Self {
        Self {
            parameters,
            last: RobotMaps::default(),
            largest: BTreeMap::new(),
            passed_on: RobotMaps::default(),
            waiting: BTreeSet::new(),
        }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<SelectedMaps>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        if !self.last.keep(&map, output, |grid| known_cells(grid.cells)) {
            // That the robot exists must be known, to report that it is not merged.
            return output.map.send_bytes(robot, map.message().bytes());
        }
        if let Some(last) = self.last.get(robot) {
            let largest = LargestMap { area: known_area(last), received: map.log_time() };
            let before = self.largest.entry(robot.to_owned()).or_insert(largest);
            if before.area <= largest.area {
                *before = largest;
            }
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
        for (robot, LargestMap { area, received }) in &self.largest {
            let last = self.last.get(robot).map(known_area);
            let Some(last) = last.filter(|last| *last < LEAST_SHARE * area) else { continue };
            output.warn(format!(
                "the last map of {robot} shows {last:.1} square metres, and that of {:.0} s before the end showed {area:.1}: its SLAM \
                 may have started again. The last one is merged; --end SECONDS ends the log earlier",
                output.log_time().seconds_since(*received)
            ));
        }
        let last = self.waiting.iter().filter_map(|robot| Some((robot, self.last.get(robot)?)));
        last.into_iter().try_for_each(|(robot, map)| output.map.send_bytes(robot, map.bytes()))
    }
}

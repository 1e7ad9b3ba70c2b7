//! Whole maps, derived from maps and their updates.

use super::super::RobotMessages;
use super::super::channel::Route;
use super::updated_maps::{UpdatedMap, UpdatedMaps};
use crate::robots::{CellValues, RobotChannels, Role};
use gridweave_runtime::ros::{OccupancyGridUpdate, decode};
use gridweave_runtime::stage::{Output, StageError};

/// Derives whole maps from map updates; `None` if that is off.
pub(super) struct DerivedMaps {
    /// `None` if no maps are made.
    maps: Option<UpdatedMaps>,
    /// How the values of their cells are read.
    values: CellValues,
}

impl DerivedMaps {
    /// Whole maps are derived if `updates_maps`.
    pub(super) fn new(updates_maps: bool, values: CellValues) -> Self {
        Self { maps: updates_maps.then(UpdatedMaps::default), values }
    }

    /// Stores a map that has updates, or applies an update to it. Returns whether the robot's map is due to be sent.
    pub(super) fn update(
        &mut self,
        route: &Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> bool {
        let Some(maps) = self.maps.as_mut().filter(|_| output.map.is_read()) else { return false };
        match route.role {
            Role::Map if roles.updates_map(&route.robot) => {
                // Consumers of the map warn if it cannot be read.
                if let Ok(map) = decode(data) {
                    maps.keep(&route.robot, &map);
                }
                false
            }
            Role::MapUpdate => {
                let updated = match decode::<OccupancyGridUpdate<'_>>(data) {
                    Ok(update) => maps.update(&route.robot, &update).map_err(|problem| problem.to_string()),
                    Err(_) => Err("they do not match their type".to_owned()),
                };
                let left_out = |why| output.warn(format!("updates on `{}` were ignored: {why}", route.channel.topic));
                updated.map_err(left_out).is_ok_and(|is_due| is_due)
            }
            _ => false,
        }
    }

    /// Applies an update, and sends the map if it is due.
    pub(super) fn send_if_due(
        &mut self,
        route: &Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if !self.update(route, roles, data, output) {
            return Ok(());
        }
        let map = self.maps.as_mut().and_then(|maps| maps.take(&route.robot));
        map.map_or(Ok(()), |map| send_map(&route.robot, map, self.values, output))
    }

    /// Sends the maps that were updated since they were last sent.
    pub(super) fn send_updated(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let values = self.values;
        let maps = self.maps.iter_mut().flat_map(UpdatedMaps::take_all);
        maps.into_iter().try_for_each(|(robot, map)| send_map(robot, map, values, output))
    }
}

fn send_map(
    robot: &str,
    map: &UpdatedMap,
    values: CellValues,
    output: &Output<RobotMessages>,
) -> Result<(), StageError> {
    let (cells, _) = values.read(&map.prefix.info, bytemuck::cast_slice(&map.cells));
    output.map.send_grid(robot, &map.prefix, |blank| blank.copy_from(bytemuck::cast_slice(&cells)))
}

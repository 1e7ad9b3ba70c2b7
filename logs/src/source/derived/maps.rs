//! Whole maps, derived from maps and their updates.

use super::super::RobotMessages;
use super::super::channel::Route;
use super::updated_maps::{UpdatedMap, UpdatedMaps};
use crate::robots::{RobotChannels, Role};
use gridweave_runtime::ros::{OccupancyGridUpdate, decode};
use gridweave_runtime::stage::{Output, StageError};

/// Derives whole maps from map updates; `None` if that is off.
pub(super) struct DerivedMaps(Option<UpdatedMaps>);

impl DerivedMaps {
    /// Whole maps are derived if `updates_maps`.
    pub(super) fn new(updates_maps: bool) -> Self {
        Self(updates_maps.then(UpdatedMaps::default))
    }

    /// Stores a map that has updates, or applies an update to it. Returns whether the robot's map is due to be sent.
    pub(super) fn update(
        &mut self,
        route: &Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> bool {
        let Some(maps) = self.0.as_mut().filter(|_| output.map.is_read()) else { return false };
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
        let map = self.0.as_mut().and_then(|maps| maps.take(&route.robot));
        map.map_or(Ok(()), |map| send_map(&route.robot, map, output))
    }

    /// Sends the maps that were updated since they were last sent.
    pub(super) fn send_updated(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let maps = self.0.iter_mut().flat_map(UpdatedMaps::take_all);
        maps.into_iter().try_for_each(|(robot, map)| send_map(robot, map, output))
    }
}

fn send_map(robot: &str, map: &UpdatedMap, output: &Output<RobotMessages>) -> Result<(), StageError> {
    output.map.send_grid(robot, &map.prefix, |blank| blank.copy_from(&map.cells))
}

//! A robot's map as it is compared, with its number.

use crate::registration::comparison::MapView;
use crate::shared::robot_maps::RobotMap;
use crate::shared::walls::{NORMAL_RADIUS, WallsOnDemand};

/// A map of a robot.
pub(super) struct NumberedMap<'a> {
    /// Number of the map among those of its robot, from 0.
    pub(super) number: u64,
    pub(super) view: MapView<'a>,
}

impl<'a> NumberedMap<'a> {
    /// The last map of a robot, with its walls.
    pub(super) fn of(map: &'a RobotMap<WallsOnDemand>) -> Self {
        Self { number: map.number, view: MapView::rigid(map.grid(), map.walls(NORMAL_RADIUS)) }
    }
}

//! What a merge has found out about each robot by itself: its tags, and the direction of its walls.

use crate::log::read_decoded;
use crate::trial::World;
use anyhow::Result;
use gridweave_runtime::ros::{MapDirection, TagEstimates};
use nalgebra::Point2;
use std::collections::BTreeMap;

/// One robot.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// The tags that it has located: their places in its map, metres, and their certainties.
    pub(super) tags: BTreeMap<String, (Point2<f64>, f64)>,
    /// The direction of its last map, radians, if that has one.
    pub(super) direction: Option<f64>,
}

impl Known {
    /// All robots of a world that has been merged, by name.
    pub(super) fn of(world: &World) -> Result<BTreeMap<String, Self>> {
        let log = world.output();
        let mut robots: BTreeMap<String, Self> = BTreeMap::new();
        read_decoded(&log, |estimates: TagEstimates| {
            let tags = estimates.tags.into_iter();
            let tags = tags.map(|tag| (tag.tag_id, (Point2::new(tag.x, tag.y), tag.certainty))).collect();
            robots.entry(estimates.robot).or_default().tags = tags;
        })?;
        read_decoded(&log, |found: MapDirection| {
            robots.entry(found.robot).or_default().direction = found.valid.then_some(found.direction);
        })?;
        Ok(robots)
    }

    /// The tags of at least some certainty.
    pub(super) fn located(&self, certainty: f64) -> Vec<(&str, Point2<f64>)> {
        let located = self.tags.iter().filter(|(_, (_, found))| *found >= certainty);
        located.map(|(tag, (place, _))| (tag.as_str(), *place)).collect()
    }
}

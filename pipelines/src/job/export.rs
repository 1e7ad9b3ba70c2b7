//! The merged map as a map file and as a picture, taken from the log that a run has written.

use super::options::RunOptions;
use crate::status::BadUse;
use crate::summary::Summary;
use anyhow::{Context, Result, bail};
use gridweave_logs::map_file::{self, GridMap};
use gridweave_logs::picture::{self, MapLayer};
use gridweave_logs::reader;
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, decode};
use gridweave_runtime::stage::{RobotTopics, match_robot};
use nalgebra::{Isometry2, Vector2};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The topic of the merged map.
const MERGED: &str = "/map";

/// What is to be made of the log that a run writes.
pub(crate) struct Exports<'a> {
    log: Option<&'a Path>,
    map: Option<&'a PathBuf>,
    picture: Option<&'a PathBuf>,
}

impl<'a> Exports<'a> {
    /// What the options ask for. An error if they ask for something that needs an output, and there is none.
    pub(crate) fn new(options: &'a RunOptions, log: Option<&'a Path>) -> Result<Self> {
        let exports = Self { log, map: options.map.as_ref(), picture: options.picture.as_ref() };
        if log.is_none() && (exports.map.is_some() || exports.picture.is_some()) {
            return Err(BadUse("--map and --picture are made from the output: give --output LOG".to_owned()).into());
        }
        Ok(exports)
    }

    /// Writes the files that were asked for.
    pub(crate) fn write(&self, summary: &Summary, robots: &RobotTopics) -> Result<()> {
        let Some(log) = self.log.filter(|_| self.map.is_some() || self.picture.is_some()) else { return Ok(()) };
        let maps = last_maps(log)?;
        let Some(merged) = maps.get(MERGED) else {
            bail!("there is no merged map to write or to draw: nothing was sent on {MERGED}, as no map says anything");
        };
        if let Some(path) = self.map {
            map_file::save(path, merged).context("cannot write the merged map")?;
        }
        if let Some(path) = self.picture {
            let layers: Vec<MapLayer<'_>> = summary
                .frames()
                .filter_map(|(robot, [x, y, yaw])| {
                    let topic = maps.keys().find(|topic| match_robot(&robots.map, topic) == Some(robot))?;
                    Some(layer(&maps[topic], Isometry2::new(Vector2::new(x, y), yaw)))
                })
                .collect();
            // A log without the input's messages holds the merged map only.
            let picture = match layers.is_empty() {
                true => picture::render_map(&layer(merged, Isometry2::identity())),
                false => picture::render_overlay(&layers),
            };
            picture.and_then(|picture| picture.save_png(path)).context("cannot draw the merged map")?;
        }
        Ok(())
    }
}

fn layer(map: &GridMap, transform_world_map: Isometry2<f64>) -> MapLayer<'_> {
    MapLayer { info: map.info, cells: &map.cells, transform_world_map }
}

/// The last grid on every topic of a log that holds grids.
pub(crate) fn last_maps(log: &Path) -> Result<BTreeMap<String, GridMap>> {
    let mut last: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    read_messages(log, OccupancyGrid::NAME, |topic, data| {
        let bytes = last.entry(topic.to_owned()).or_default();
        bytes.clear();
        bytes.extend_from_slice(data);
    })?;
    // A map that cannot be used was warned of when it was read for the merge.
    let decoded = last.into_iter().filter_map(|(topic, bytes)| {
        let grid: OccupancyGrid<'_> = decode(&bytes).ok()?;
        Some((topic, GridMap::from_message(&grid)))
    });
    Ok(decoded.collect())
}

/// Hands out every message of one ROS 2 type in a log by log time: its topic and its bytes.
pub(crate) fn read_messages(log: &Path, ros_type: &str, mut each: impl FnMut(&str, &[u8])) -> Result<()> {
    let mut reader = reader::open(&[log.to_owned()])?;
    let files = Arc::clone(reader.files());
    // For each channel, its topic if it carries the type.
    let mut topics: BTreeMap<u16, Option<String>> = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let topic = topics.entry(message.channel).or_insert_with(|| {
            let channel = files[message.file].channel(message.channel)?;
            (full_type_name(&channel.schema_name) == ros_type).then_some(channel.topic)
        });
        if let Some(topic) = topic {
            each(topic, message.data);
        }
    }
    Ok(())
}

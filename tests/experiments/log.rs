//! What an experiment takes out of the logs that merges have written.

use anyhow::{Context, Result};
use gridweave_logs::map_file::GridMap;
use gridweave_logs::reader;
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, decode};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

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

/// Passes every message of a type in a log to `each`, by log time.
pub(crate) fn read_decoded<T: RosMessage + DeserializeOwned>(log: &Path, mut each: impl FnMut(T)) -> Result<()> {
    let mut broken = None;
    read_messages(log, T::NAME, |_, data| match decode(data) {
        Ok(message) => each(message),
        Err(error) => broken = Some(error),
    })?;
    match broken {
        Some(error) => Err(error).with_context(|| format!("cannot read the messages {} of {}", T::NAME, log.display())),
        None => Ok(()),
    }
}

/// Passes the topic and the bytes of every message of a ROS 2 type in a log to `each`, by log time.
fn read_messages(log: &Path, ros_type: &str, mut each: impl FnMut(&str, &[u8])) -> Result<()> {
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

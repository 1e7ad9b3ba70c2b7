//! Map files, read as logs of one message, so that the map of one robot can be given beside the log of another.

use super::bytes::FileBytes;
use crate::map_file::{Thresholds, load_as};
use crate::qos;
use crate::schemas::schema_text;
use crate::temporary;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, encode};
use std::io::BufWriter;
use std::path::Path;

/// The log time of the map. Files have no time, and 0 is "no time" in ROS.
const TIME: LogTime = LogTime(1_000_000_000);
const TOPIC: &str = "/map";

/// Whether a file has the name of a map's YAML file, and not of a bag's metadata.
pub(crate) fn is_called_so(path: &Path) -> bool {
    let is_yaml =
        path.extension().is_some_and(|ending| ["yaml", "yml"].iter().any(|yaml| ending.eq_ignore_ascii_case(yaml)));
    is_yaml && path.file_name().is_some_and(|name| name != "metadata.yaml")
}

/// Writes the map, with this treatment of its thresholds, as a log (MCAP) to an unnamed temporary file.
pub(crate) fn as_log(path: &Path, thresholds: Thresholds) -> Result<FileBytes, String> {
    let (map, _) = load_as(path, thresholds).map_err(|error| error.to_string())?;
    let header = Header::new(TIME, "map");
    let message = OccupancyGrid { header, info: map.info, data: bytemuck::cast_slice(&map.cells) };
    let bytes = encode(&message).map_err(|error| error.to_string())?;
    let temporary =
        |error: &dyn std::fmt::Display| format!("{}: cannot write a temporary file: {error}", path.display());
    let write = || -> Result<std::fs::File, mcap::McapError> {
        let file = temporary::file()?;
        let mut writer = mcap::WriteOptions::new().compression(None).create(BufWriter::new(file.try_clone()?))?;
        let text = schema_text(OccupancyGrid::NAME).unwrap_or_default();
        let schema = writer.add_schema(OccupancyGrid::NAME, "ros2msg", text.as_bytes())?;
        let channel_id = writer.add_channel(schema, TOPIC, "cdr", &qos::metadata(TOPIC, OccupancyGrid::NAME))?;
        let header = mcap::records::MessageHeader { channel_id, sequence: 1, log_time: TIME.0, publish_time: TIME.0 };
        writer.write_to_known_channel(&header, &bytes)?;
        writer.finish()?;
        writer.into_inner().into_inner().map_err(|error| error.into_error())?;
        Ok(file)
    };
    let file = write().map_err(|error| temporary(&error))?;
    FileBytes::of(file).map_err(|error| temporary(&error))
}

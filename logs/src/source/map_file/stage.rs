//! The stage `map_file_source`.

use super::{FileMaps, MapFileSourceParameters};
use crate::map_file::{self, GridMap, Room, Thresholds};
use crate::names::name_map_files;
use crate::qos;
use crate::robots::unit_of_map;
use crate::schemas::schema_text;
use gridweave_runtime::message::{Channel, FixedText, LogTime, MessageHeader, TextTooLong};
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, encode};
use gridweave_runtime::stage::{Context, Output, Source, StageError};
use std::path::PathBuf;
use std::sync::Arc;

/// The interval of log times. Files have no time, and 0 is "no time" in ROS, so the first map is logged one interval
/// after the epoch. The interval is long enough for each map to be processed before the next.
pub(crate) const INTERVAL: u64 = 1_000_000_000;

/// Reads map files; see the [module](super).
pub struct MapFileSource {
    /// Sorted by the robots' names, so that the order of the files does not matter.
    maps: Vec<NamedMap>,
    sent: usize,
    room: Room,
}

/// A map, and the name of its robot.
struct NamedMap {
    robot: String,
    topic: String,
    map: Origin,
}

/// Where a map comes from.
enum Origin {
    /// A file, and the side of a cell, metres, if it is not that of the file.
    File(PathBuf, Thresholds, Option<f64>),
    Memory(Arc<GridMap>),
}

impl MapFileSource {
    /// Names the robots. Each file is read when its map is sent.
    pub fn new(parameters: MapFileSourceParameters, context: &Context) -> Result<Self, StageError> {
        let doing = "read the map files";
        if parameters.files.is_empty() {
            let help = "give --input FILE.yaml for each robot, or files = [...]";
            return Err(StageError::new(doing, "no input file").with_help(help));
        }
        let files = name_map_files(&parameters.files).map_err(|error| StageError::new(doing, error))?;
        let thresholds = if parameters.literal_thresholds { Thresholds::Literal } else { Thresholds::ByPicture };
        let names: Vec<&str> = files.iter().map(|(robot, _)| robot.as_str()).collect();
        if let Some(robot) = parameters.resolutions.keys().find(|robot| !names.contains(&robot.as_str())) {
            let help = format!("the robots are {}", list_in_words(names));
            let error = format!("`resolutions` names `{robot}`, which has no map");
            return Err(StageError::new(doing, error).with_help(help));
        }
        let files = files.into_iter().map(|(robot, file)| {
            let resolution = parameters.resolutions.get(&robot).copied();
            (robot, Origin::File(file, thresholds, resolution))
        });
        Ok(Self::named(files, context))
    }

    /// A source of maps that are in memory, each with the name of its robot.
    pub(super) fn of_maps(maps: &[(String, Arc<GridMap>)], context: &Context) -> Self {
        Self::named(maps.iter().map(|(robot, map)| (robot.clone(), Origin::Memory(Arc::clone(map)))), context)
    }

    fn named(maps: impl Iterator<Item = (String, Origin)>, context: &Context) -> Self {
        let named = |(robot, map): (String, Origin)| {
            let topic = context.robots.map.replace("{robot}", &robot);
            NamedMap { robot, topic, map }
        };
        let mut maps: Vec<NamedMap> = maps.map(named).collect();
        maps.sort_by(|one, other| one.robot.cmp(&other.robot));
        Self { maps, sent: 0, room: Room::default() }
    }
}

impl Source for MapFileSource {
    type Outputs = FileMaps;

    fn next(&mut self, output: &Output<FileMaps>) -> Result<bool, StageError> {
        let Some(map) = self.maps.get(self.sent) else { return Ok(false) };
        self.sent += 1;
        output.set_log_time(LogTime(self.sent as u64 * INTERVAL));
        // 0 is the channel of messages that no log describes.
        map.send(self.sent as u32, &mut self.room, output)?;
        Ok(self.sent < self.maps.len())
    }

    fn progress(&self) -> Option<f64> {
        Some(self.sent as f64 / self.maps.len().max(1) as f64)
    }
}

impl NamedMap {
    /// Sends the map on a channel for itself, as a log would. A file takes of the `room` that there is for all.
    fn send(&self, channel_number: u32, room: &mut Room, output: &Output<FileMaps>) -> Result<(), StageError> {
        match &self.map {
            Origin::Memory(map) => self.send_map(map, channel_number, output),
            Origin::File(file, thresholds, resolution) => {
                let loaded = map_file::load_within(file, *thresholds, room);
                let (mut map, warning) = loaded.map_err(|error| StageError::new("read a map file", error))?;
                if let Some(warning) = warning {
                    output.warn(format!("{}: {warning}", file.display()));
                }
                map.info.resolution = resolution.map_or(map.info.resolution, |side| side as f32);
                if let Some(unit) = unit_of_map(&map.info) {
                    output.warn(format!("{}: {unit}", file.display()));
                }
                self.send_map(&map, channel_number, output)
            }
        }
    }

    fn send_map(&self, map: &GridMap, channel_number: u32, output: &Output<FileMaps>) -> Result<(), StageError> {
        let doing = || format!("send the map of {}", self.robot);
        let time = output.log_time();
        let header = Header::new(time, format!("{}/map", self.robot));
        let message = OccupancyGrid { header, info: map.info, data: bytemuck::cast_slice(&map.cells) };
        let bytes = encode(&message).map_err(|error| StageError::new(doing(), error))?;

        let too_long =
            |error: TextTooLong| StageError::new(doing(), error).with_help("ROBOT=FILE.yaml names the robot of a map");
        let header = MessageHeader {
            log_time: time,
            publish_time: time.0,
            channel: channel_number,
            robot: FixedText::new(&self.robot).map_err(too_long)?,
            topic: FixedText::new(&self.topic).map_err(too_long)?,
            ..Default::default()
        };
        let channel = Channel {
            topic: self.topic.clone(),
            message_encoding: "cdr".into(),
            schema_name: OccupancyGrid::NAME.into(),
            schema_encoding: "ros2msg".into(),
            schema: schema_text(OccupancyGrid::NAME).unwrap_or_default().into_bytes(),
            metadata: qos::metadata(&self.topic, OccupancyGrid::NAME),
        };
        output.0.announce(channel_number, &channel)?;
        output.0.send_encoded(header, &bytes)
    }
}

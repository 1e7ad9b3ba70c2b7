//! The stage `map_file_source`.

use super::{FileMaps, MapFileSourceParameters};
use crate::map_file::{self, Thresholds};
use crate::names::robot_names;
use crate::qos;
use crate::schemas::schema_text;
use gridweave_runtime::message::{Channel, FixedText, LogTime, MessageHeader};
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, encode};
use gridweave_runtime::stage::{Context, Output, Source, StageError};
use std::path::PathBuf;

/// Files tell no time. The first map is logged so long after the epoch, since 0 stands for no time in ROS, and each other
/// so long after the one before: what follows from one map can be handled before the next, however many there are.
const INTERVAL: u64 = 1_000_000_000;

/// Reads map files; see the [module](super).
pub struct MapFileSource {
    /// By the robots' names, so that the order in which files are given changes nothing.
    maps: Vec<NamedMap>,
    sent: usize,
}

/// A map, and what its robot is called.
struct NamedMap {
    robot: String,
    file: PathBuf,
    topic: String,
    thresholds: Thresholds,
}

impl MapFileSource {
    /// Names the robots. The files are read one after the other, each when it is to be sent.
    pub fn new(parameters: MapFileSourceParameters, context: &Context) -> Result<Self, StageError> {
        let doing = || format!("read the map files of stage `{}`", context.stage);
        if parameters.files.is_empty() {
            let help = "give --input FILE.yaml for each robot, or files = [...]";
            return Err(StageError::new(doing(), "no file is given").with_help(help));
        }
        let names = robot_names(&parameters.files).map_err(|error| StageError::new(doing(), error))?;
        let thresholds = if parameters.literal_thresholds { Thresholds::Literal } else { Thresholds::ByPicture };
        let named = |(robot, file): (String, PathBuf)| {
            let topic = context.robots.map.replace("{robot}", &robot);
            NamedMap { robot, file, topic, thresholds }
        };
        let mut maps: Vec<NamedMap> = names.into_iter().zip(parameters.files).map(named).collect();
        maps.sort_by(|one, other| one.robot.cmp(&other.robot));
        Ok(Self { maps, sent: 0 })
    }
}

impl Source for MapFileSource {
    type Outputs = FileMaps;

    fn next(&mut self, output: &Output<FileMaps>) -> Result<bool, StageError> {
        let Some(map) = self.maps.get(self.sent) else { return Ok(false) };
        self.sent += 1;
        output.set_log_time(LogTime(self.sent as u64 * INTERVAL));
        // Channel 0 stands for messages that no log has described.
        map.send(self.sent as u32, output)?;
        Ok(self.sent < self.maps.len())
    }

    fn progress(&self) -> Option<f64> {
        Some(self.sent as f64 / self.maps.len().max(1) as f64)
    }
}

impl NamedMap {
    /// Sends the map on a channel of its own, as a log would.
    fn send(&self, channel_number: u32, output: &Output<FileMaps>) -> Result<(), StageError> {
        let doing = || format!("send the map {}", self.file.display());
        let loaded = map_file::load_as(&self.file, self.thresholds);
        let (map, remark) = loaded.map_err(|error| StageError::new("read a map file", error))?;
        if let Some(remark) = remark {
            output.warn(format!("{}: {remark}", self.file.display()));
        }
        let time = output.log_time();
        let header = Header::new(time, format!("{}/map", self.robot));
        let message = OccupancyGrid { header, info: map.info, data: bytemuck::cast_slice(&map.cells) };
        let bytes = encode(&message).map_err(|error| StageError::new(doing(), error))?;

        let header = MessageHeader {
            log_time: time,
            publish_time: time.0,
            channel: channel_number,
            robot: FixedText::new(&self.robot).map_err(|error| StageError::new(doing(), error))?,
            topic: FixedText::new(&self.topic).map_err(|error| StageError::new(doing(), error))?,
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

//! Logs and maps made up for tests, and for the inputs of golden cases.

use gridweave_logs::schemas::schema_text;
use gridweave_logs::sink::{LogOptions, LogWriter, Outcome};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{
    Header, MapMetaData, OccupancyGrid, Pose, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange, encode,
};
use mcap::records::MessageHeader;
use nalgebra::{Isometry2, Vector2};
use serde::Serialize;
use std::path::Path;

/// When these logs begin: 14 November 2023, 22:13:20 UTC.
const START: u64 = 1_700_000_000_000_000_000;

/// The header of a message at a time of the log, seconds from its start.
pub fn header(seconds: f64, frame_id: impl Into<String>) -> Header {
    Header::new(log_time(seconds), frame_id)
}

fn log_time(seconds: f64) -> LogTime {
    LogTime(START + (seconds * 1e9).round() as u64)
}

/// Writes a log message by message.
pub struct LogBuilder {
    writer: LogWriter,
    sequence: u32,
}

impl LogBuilder {
    /// An empty log.
    pub fn new(path: &Path) -> Self {
        Self { writer: LogWriter::create(path, LogOptions::default()).unwrap(), sequence: 0 }
    }

    /// A message of any type, its bytes given.
    pub fn raw(&mut self, seconds: f64, topic: &str, type_name: &str, bytes: &[u8]) -> &mut Self {
        let channel = Channel {
            topic: topic.into(),
            message_encoding: "cdr".into(),
            schema_name: type_name.into(),
            schema_encoding: "ros2msg".into(),
            schema: schema_text(type_name).unwrap_or_default().into_bytes(),
            ..Default::default()
        };
        let channel_id = self.writer.channel(&channel).unwrap();
        let LogTime(time) = log_time(seconds);
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence += 1;
        self.writer.write(&header, bytes).unwrap();
        self
    }

    /// A message.
    pub fn message<T: RosMessage + Serialize>(&mut self, seconds: f64, topic: &str, message: &T) -> &mut Self {
        self.raw(seconds, topic, T::NAME, &encode(message).unwrap())
    }

    /// A map of `robot`.
    pub fn map(&mut self, seconds: f64, robot: &str, map: &TestMap) -> &mut Self {
        let bytes: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
        let header = header(seconds, format!("{robot}/map"));
        self.message(seconds, &format!("/{robot}/map"), &OccupancyGrid { header, info: map.info, data: &bytes })
    }

    /// A pose of `robot` in its map, metres, whose covariance is not known.
    pub fn pose(&mut self, seconds: f64, robot: &str, x: f64, y: f64) -> &mut Self {
        let header = header(seconds, format!("{robot}/map"));
        let pose = Pose::from(Isometry2::new(Vector2::new(x, y), 0.0));
        self.message(seconds, &format!("/{robot}/pose"), &PoseStamped { header, pose })
    }

    /// A pose whose position is known to so many metres; 0 if that is not known.
    pub fn uncertain_pose(&mut self, seconds: f64, robot: &str, x: f64, y: f64, deviation: f64) -> &mut Self {
        let header = header(seconds, format!("{robot}/map"));
        let pose = Pose::from(Isometry2::new(Vector2::new(x, y), 0.0));
        let mut message = PoseWithCovarianceStamped::from(PoseStamped { header, pose });
        (message.pose.covariance[0][0], message.pose.covariance[1][1]) = (deviation.powi(2), deviation.powi(2));
        self.message(seconds, &format!("/{robot}/pose"), &message)
    }

    /// A reading of a tag by `robot`, metres.
    pub fn reading(&mut self, seconds: f64, robot: &str, tag: &str, range: f64) -> &mut Self {
        let header = header(seconds, format!("{robot}/base_link"));
        let reading = TagRange { header, tag_id: tag.into(), range, range_stddev: 0.05, rssi: -50.0 };
        self.message(seconds, &format!("/{robot}/tag_ranges"), &reading)
    }

    /// Closes the log.
    pub fn finish(self) {
        self.writer.finish(Outcome::Complete).unwrap();
    }
}

/// A map that can be spoilt.
#[derive(Clone)]
pub struct TestMap {
    /// Size, resolution and origin.
    pub info: MapMetaData,
    /// The cells row by row.
    pub cells: Vec<i8>,
}

impl TestMap {
    /// A map of which every cell says the same.
    pub fn filled(width: u32, height: u32, resolution: f32, value: i8) -> Self {
        let info = MapMetaData { resolution, width, height, ..Default::default() };
        Self { info, cells: vec![value; width as usize * height as usize] }
    }

    /// The same map, its outer corner at (x, y) metres and turned by `yaw` radians.
    pub fn at(mut self, x: f64, y: f64, yaw: f64) -> Self {
        self.info.origin = Isometry2::new(Vector2::new(x, y), yaw).into();
        self
    }

    /// A room of 10 x 8 m with an inner wall, at 0.05 m a cell.
    pub fn room() -> Self {
        let (width, height) = (200, 160);
        let mut map = Self::filled(width as u32, height as u32, 0.05, 0);
        for row in 0..height {
            for column in 0..width {
                let is_wall = row < 2 || column < 2 || row >= height - 2 || column >= width - 2;
                let is_inner = (80..82).contains(&column) && row < 100;
                if is_wall || is_inner {
                    map.cells[row * width + column] = 100;
                }
            }
        }
        map
    }

    /// The room with more walls and furniture inside, so that it looks like itself from one side only.
    pub fn flat() -> Self {
        let mut map = Self::room();
        let width = map.info.width as usize;
        let walls = [(60..62, 130..200), (110..160, 120..122), (30..32, 0..40)];
        let furniture = [(20..32, 150..170), (120..140, 30..40), (85..97, 150..162), (136..144, 150..178)];
        for (rows, columns) in walls.into_iter().chain(furniture) {
            for row in rows {
                map.cells[row * width..][columns.clone()].fill(100);
            }
        }
        map
    }
}

mod contents;
mod files;

use super::*;
use crate::sink::kind;
use gridweave_runtime::message::{LogTime, MessageHeader};
use gridweave_runtime::ros::{self, OccupancyGrid, Segments, TFMessage};
use gridweave_runtime::stage::{InputWire, StageHarness};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const GRID: &str = "nav_msgs/msg/OccupancyGrid";
const TF: &str = "tf2_msgs/msg/TFMessage";
const SEGMENTS: &str = "gridweave_msgs/msg/Segments";

/// A sink with two sources on wires 0 and 1, and results on wires 2 (`/map`), 3 (`/tf_static`) and 4 (segments).
struct Run {
    folder: TempDir,
    sink: StageHarness,
}

fn context() -> Context {
    let wires = [("", ""), ("", ""), (GRID, "/map"), (TF, "/tf_static"), (SEGMENTS, "/{robot}/lines/segments")];
    let wire = |(ros_type, topic): (&str, &str)| InputWire {
        port: "messages",
        ros_type: ros_type.into(),
        topic: topic.into(),
        ..Default::default()
    };
    Context { stage: "sink".into(), inputs: wires.map(wire).to_vec(), ..Default::default() }
}

fn make(file: &Path, more: &str) -> Result<StageHarness, StageError> {
    StageHarness::with_context(&kind(), &format!("file = {file:?}\n{more}"), &context())
}

impl Run {
    fn new(more: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let sink = make(&folder.path().join("out.mcap"), more).unwrap();
        Self { folder, sink }
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("out.mcap")
    }

    fn announce(&mut self, wire: usize, number: u32, topic: &str, schema_name: &str) {
        let channel = Channel {
            topic: topic.into(),
            message_encoding: "cdr".into(),
            schema_name: schema_name.into(),
            schema_encoding: "ros2msg".into(),
            schema: b"# from the input".to_vec(),
            metadata: BTreeMap::from([("offered_qos_profiles".into(), "theirs".into())]),
        };
        self.sink.node().announce(wire, number, &channel).unwrap();
    }

    /// Sends a message of input channel `number`.
    fn input(&mut self, wire: usize, number: u32, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        self.send(wire, number, "/not/used", time, bytes)
    }

    /// Sends a result of a stage.
    fn result(&mut self, wire: usize, topic: &str, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        self.send(wire, 0, topic, time, bytes)
    }

    fn send(&mut self, wire: usize, channel: u32, topic: &str, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        let header = MessageHeader {
            log_time: LogTime(time),
            publish_time: time + 1,
            channel,
            log_sequence: 40 + time as u32,
            topic: FixedText::new(topic).unwrap(),
            ..Default::default()
        };
        let message = Message::from_vec(header, bytes.to_vec()).on_wire(wire);
        self.sink.give_message("messages", message)
    }

    fn finish(&mut self) {
        self.sink.finish(LogTime(0)).unwrap();
    }

    fn log(&self) -> Log {
        Log::read(&self.file())
    }
}

/// A message as read back: topic, type, sequence, log time, publish time, bytes.
type Read = (String, String, u32, u64, u64, Vec<u8>);

struct Log {
    messages: Vec<Read>,
    channels: Vec<mcap::Channel<'static>>,
    chunks: usize,
    outcome: BTreeMap<String, String>,
}

impl Log {
    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
            let message = message.unwrap();
            let schema = message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
            let (log_time, publish_time) = (message.log_time, message.publish_time);
            (message.channel.topic.clone(), schema, message.sequence, log_time, publish_time, message.data.to_vec())
        });
        let outcome = summary.metadata_indexes.iter().find(|index| index.name == "gridweave").unwrap();
        let mut channels: Vec<_> = summary.channels.values().map(|channel| (**channel).clone()).collect();
        channels.sort_by_key(|channel| channel.id);
        Self {
            messages: messages.collect(),
            channels,
            chunks: summary.chunk_indexes.len(),
            outcome: mcap::read::metadata(&bytes, outcome).unwrap().metadata,
        }
    }

    fn topics(&self) -> Vec<&str> {
        self.messages.iter().map(|message| message.0.as_str()).collect()
    }
}

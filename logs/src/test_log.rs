//! Small logs for tests.

use crate::schemas::schema_text;
use gridweave_runtime::ros::encode;
use mcap::WriteOptions;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

/// Writes a log to memory.
pub(crate) struct TestLog {
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    sequence: u32,
}

impl TestLog {
    pub(crate) fn new(options: WriteOptions) -> Self {
        Self { writer: options.profile("ros2").create(Cursor::new(Vec::new())).unwrap(), sequence: 0 }
    }

    /// Adds a message of raw bytes.
    pub(crate) fn raw(&mut self, topic: &str, type_name: &str, time: u64, data: &[u8]) -> &mut Self {
        self.with_metadata(topic, type_name, time, data, &BTreeMap::new())
    }

    /// Adds a message on a channel with metadata.
    pub(crate) fn with_metadata(
        &mut self,
        topic: &str,
        type_name: &str,
        time: u64,
        data: &[u8],
        metadata: &BTreeMap<String, String>,
    ) -> &mut Self {
        let text = schema_text(type_name).unwrap_or_default();
        let schema = self.writer.add_schema(type_name, "ros2msg", text.as_bytes()).unwrap();
        let channel_id = self.writer.add_channel(schema, topic, "cdr", metadata).unwrap();
        self.sequence += 1;
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: time,
            publish_time: time.saturating_sub(1),
        };
        self.writer.write_to_known_channel(&header, data).unwrap();
        self
    }

    /// Adds a chunk without messages.
    pub(crate) fn empty_chunk(&mut self) -> &mut Self {
        self.flush().silent("/silent", "p/msg/Silent").flush()
    }

    /// Adds a channel without messages.
    pub(crate) fn silent(&mut self, topic: &str, type_name: &str) -> &mut Self {
        let text = schema_text(type_name).unwrap_or_default();
        let schema = self.writer.add_schema(type_name, "ros2msg", text.as_bytes()).unwrap();
        self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        self
    }

    /// Adds a ROS message.
    pub(crate) fn add(&mut self, topic: &str, type_name: &str, time: u64, message: &impl Serialize) -> &mut Self {
        self.raw(topic, type_name, time, &encode(message).unwrap())
    }

    /// Closes the chunk.
    pub(crate) fn flush(&mut self) -> &mut Self {
        self.writer.flush().unwrap();
        self
    }

    /// Finishes the log and returns its bytes.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }
}

/// Four layouts of a log.
pub(crate) fn layouts() -> [WriteOptions; 4] {
    [
        WriteOptions::new().use_chunks(false),
        WriteOptions::new().compression(None),
        WriteOptions::new().compression(Some(mcap::Compression::Lz4)),
        WriteOptions::new().compression(Some(mcap::Compression::Zstd)),
    ]
}

/// A temporary folder for the logs of one test, deleted on drop.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    /// Writes a file and returns its path.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

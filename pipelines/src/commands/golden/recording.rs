//! The messages that a stage has sent, or is expected to send, and their log.

use anyhow::{Context, Result, bail};
use gridweave_logs::reader;
use gridweave_logs::sink::{LogOptions, LogWriter, Outcome};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::encode;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The metadata record of the stage's warnings, each with its count.
const WARNINGS: &str = "gridweave_warnings";

/// A recorded message.
#[derive(Clone, Debug)]
pub(super) struct Recorded {
    /// Its topic and type.
    pub(super) channel: Arc<Channel>,
    /// The output port that has sent it; `None` if it was read from a log.
    pub(super) port: Option<usize>,
    pub(super) log_time: LogTime,
    /// Nanoseconds.
    pub(super) publish_time: u64,
    pub(super) bytes: Vec<u8>,
}

/// All messages of a stage, by log time, and its warnings.
#[derive(Clone, Debug, Default)]
pub(super) struct Recording {
    pub(super) messages: Vec<Recorded>,
    /// Every warning with its count.
    pub(super) warnings: BTreeMap<String, u64>,
}

impl Recording {
    /// Reads a log. A damaged log is an error.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let mut reader = reader::open(&[path.to_owned()])?;
        let files = Arc::clone(reader.files());
        if let Some(damage) = files.iter().flat_map(|file| file.damage()).next() {
            bail!("{}: {damage}", path.display());
        }
        let mut channels: BTreeMap<(usize, u16), Arc<Channel>> = BTreeMap::new();
        let mut recording = Self::default();
        while let Some(message) = reader.next_message() {
            let channel = match channels.entry((message.file, message.channel)) {
                std::collections::btree_map::Entry::Occupied(entry) => Arc::clone(entry.get()),
                std::collections::btree_map::Entry::Vacant(entry) => {
                    let Some(channel) = files[message.file].channel(message.channel) else {
                        bail!("{}: it does not describe the channel {}", path.display(), message.channel);
                    };
                    Arc::clone(entry.insert(Arc::new(channel)))
                }
            };
            recording.messages.push(Recorded {
                channel,
                port: None,
                log_time: message.log_time,
                publish_time: message.publish_time,
                bytes: message.data.to_vec(),
            });
        }
        if let Some((_, damage)) = reader.take_damage().first() {
            bail!("{}: {damage}", path.display());
        }
        for (warning, count) in files.iter().filter_map(|file| file.metadata(WARNINGS)).flatten() {
            let count = count.parse();
            let count = count.with_context(|| format!("{}: the warning `{warning}` has no count", path.display()))?;
            recording.warnings.insert(warning.clone(), count);
        }
        Ok(recording)
    }

    /// Reads a file that a stage has written: the messages of a log, or any other file as one message.
    pub(super) fn read_file(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        if bytes.starts_with(mcap::MAGIC) {
            return Self::read(path);
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let channel = Channel {
            topic: format!("/{name}"),
            message_encoding: "cdr".to_owned(),
            schema_name: "gridweave_msgs/msg/File".to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: b"uint8[] data".to_vec(),
            ..Default::default()
        };
        let bytes = encode(&serde_bytes::Bytes::new(&bytes))?;
        let message =
            Recorded { channel: Arc::new(channel), port: None, log_time: LogTime::MIN, publish_time: 0, bytes };
        Ok(Self { messages: vec![message], warnings: BTreeMap::new() })
    }

    /// Writes a log. The same recording gives the same bytes.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        let mut log = LogWriter::create(path, LogOptions::default())?;
        let mut sequences: BTreeMap<u16, u32> = BTreeMap::new();
        for message in &self.messages {
            let channel_id = log.channel(&message.channel)?;
            let sequence = sequences.entry(channel_id).or_default();
            let (log_time, publish_time) = (message.log_time.0, message.publish_time);
            let header = MessageHeader { channel_id, sequence: *sequence, log_time, publish_time };
            log.write(&header, &message.bytes)?;
            *sequence = sequence.wrapping_add(1);
        }
        if !self.warnings.is_empty() {
            let warnings = self.warnings.iter().map(|(warning, count)| (warning.clone(), count.to_string()));
            log.metadata(WARNINGS, warnings.collect())?;
        }
        log.finish(Outcome::Complete)?;
        Ok(())
    }

    /// Groups the messages by topic, each by log time.
    pub(super) fn by_topic(&self) -> BTreeMap<&str, Vec<&Recorded>> {
        let mut topics: BTreeMap<&str, Vec<&Recorded>> = BTreeMap::new();
        for message in &self.messages {
            topics.entry(&message.channel.topic).or_default().push(message);
        }
        topics.values_mut().for_each(|messages| messages.sort_by_key(|message| message.log_time));
        topics
    }
}

//! `gridweave record`: writes the messages of links of a run to a log.

use super::MESSAGE_INTERVAL;
use super::link_choice::{Link, all_links, chosen_links};
use super::running::{RunChoice, Running, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::job::check_mcap_ending;
use crate::status::Status;
use crate::terminal::print_line;
use anyhow::{Result, bail};
use clap::Args;
use gridweave_logs::file::check_writable;
use gridweave_logs::reader::SupplementKind;
use gridweave_logs::sink::{LogOptions, LogWriter, Outcome, result_channel, write_supplement};
use gridweave_runtime::engine::WatchedLink;
use gridweave_runtime::message::{Channel, Message, MessageFlags};
use gridweave_runtime::stage::{PortType, Registry};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

/// Arguments of `gridweave record`.
#[derive(Debug, Args)]
pub(crate) struct RecordArgs {
    /// The MCAP file to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// The links: STAGE.PORT, or STAGE for all its outputs; by default all links of the run.
    #[arg(value_name = "LINK")]
    pub(crate) links: Vec<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// Messages are flushed at this interval, so that a crash loses no more than these.
const FLUSH_INTERVAL: Duration = Duration::from_millis(500);

/// Records links until the run ends or the user interrupts it.
pub(crate) fn record(args: &RecordArgs, registry: &Registry) -> Result<Status> {
    check_mcap_ending(&args.output)?;
    check_writable(&args.output)?;
    let running = find_run(&args.run, registry)?;
    let links = match args.links.is_empty() {
        true => all_links(&running.pipeline),
        false => chosen_links(&args.links, &running.pipeline)?,
    };
    let stop = stop_on_interrupt("the recording is being closed");
    let mut recorders = links.iter().map(|&link| Recorder::new(&running, link)).collect::<Result<Vec<_>>>()?;
    let mut writer = LogWriter::create(&args.output, LogOptions::default())?;
    let mut flushed = Instant::now();
    let mut messages = 0;
    loop {
        // Messages that were sent before the end of the run can be read after it.
        let is_last_look = stop.load(Ordering::Relaxed) || !running.run.is_running();
        for recorder in &mut recorders {
            messages += recorder.record(&mut writer)?;
        }
        if is_last_look {
            break;
        }
        if flushed.elapsed() >= FLUSH_INTERVAL {
            writer.flush()?;
            flushed = Instant::now();
        }
        thread::sleep(MESSAGE_INTERVAL);
    }
    let missed: u64 = recorders.iter().map(|recorder| recorder.link.missed()).sum();
    let untyped: u64 = recorders.iter().map(|recorder| recorder.channels.untyped).sum();
    let reason = match (missed, untyped) {
        (0, 0) => None,
        (missed, 0) => Some(format!("{missed} messages were missed: the recorder was too slow")),
        (_, untyped) => Some(format!("{missed} messages were missed, and {untyped} were of an unknown type")),
    };
    let written = writer.finish(reason.as_deref().map_or(Outcome::Complete, Outcome::Incomplete))?;
    print_line(format_args!("recorded {messages} messages of {} links to {}", links.len(), written.display()))?;
    match reason {
        Some(reason) => bail!("{}: {reason}", written.display()),
        None => Ok(Status::Done),
    }
}

/// One link that is recorded.
struct Recorder {
    link: WatchedLink,
    channels: LogChannels,
}

impl Recorder {
    fn new(running: &Running, link: Link) -> Result<Self> {
        let kind = &running.pipeline.stages[link.stage].kind;
        let port_type = match kind.outputs[link.port].port_type {
            PortType::Ros(name) => Some(name),
            PortType::Any => None,
        };
        let definition = port_type.and_then(|name| kind.definition(name)).unwrap_or_default().to_owned();
        let link = WatchedLink::open(&running.run, &running.pipeline, link.stage, link.port)?;
        Ok(Self { link, channels: LogChannels { port_type, definition, ..LogChannels::default() } })
    }

    /// Writes the messages since the last call. Returns their number.
    fn record(&mut self, writer: &mut LogWriter) -> Result<u64> {
        let mut passed = Vec::new();
        self.link.take(|_, message| passed.push(message))?;
        let mut count = 0;
        for message in &passed {
            count += u64::from(self.channels.write(message, writer)?);
        }
        Ok(count)
    }
}

/// Channels of the log for the messages of a link.
#[derive(Default)]
struct LogChannels {
    /// The type of messages without an announced channel.
    port_type: Option<&'static str>,
    /// The definition of that type, if the stage has one.
    definition: String,
    announced: BTreeMap<u32, Channel>,
    /// Channels of the log by announced number and topic.
    ids: BTreeMap<(u32, String), u16>,
    /// Number of messages on channels that were announced before the recording began, which cannot be written.
    untyped: u64,
}

impl LogChannels {
    /// Writes a message. Returns `false` for the announcement of a channel, an attachment, a metadata record, or an
    /// unknown type.
    fn write(&mut self, message: &Message, writer: &mut LogWriter) -> Result<bool> {
        let header = message.header();
        if header.flags.contains(MessageFlags::CHANNEL) {
            self.announced.insert(header.channel, Channel::decode(message.bytes())?);
            return Ok(false);
        }
        if let Some(kind) = self.announced.get(&header.channel).and_then(SupplementKind::of_channel) {
            // Damage was reported where the record was read.
            write_supplement(writer, kind, message.bytes())?;
            return Ok(false);
        }
        let topic = header.topic.as_str();
        let key = (header.channel, topic.to_owned());
        let channel_id = match self.ids.get(&key) {
            Some(id) => *id,
            None => {
                let Some(channel) = self.channel(header.channel, topic) else {
                    self.untyped += 1;
                    return Ok(false);
                };
                let id = writer.channel(&channel)?;
                self.ids.insert(key, id);
                id
            }
        };
        let (log_time, publish_time) = (header.log_time.0, header.publish_time);
        let header = MessageHeader { channel_id, sequence: header.log_sequence, log_time, publish_time };
        writer.write(&header, message.bytes())?;
        Ok(true)
    }

    fn channel(&self, number: u32, topic: &str) -> Option<Channel> {
        if let Some(channel) = self.announced.get(&number) {
            return Some(channel.clone());
        }
        let channel = result_channel(topic, self.port_type?, &self.definition);
        // Messages of a type without a definition could not be decoded from the log.
        (!channel.schema.is_empty()).then_some(channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_logs::reader::LogFile;
    use gridweave_runtime::message::{FixedText, LogTime, MessageHeader as Header};

    fn message(flags: MessageFlags, channel: u32, topic: &str, bytes: Vec<u8>) -> Message {
        let topic = FixedText::new(topic).unwrap();
        Message::from_vec(Header { flags, channel, topic, log_time: LogTime(5), ..Default::default() }, bytes)
    }

    /// The body of a metadata record by the MCAP specification.
    fn metadata() -> Vec<u8> {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let pairs = [text("weather"), text("rain")].concat();
        [text("drive"), (pairs.len() as u32).to_le_bytes().to_vec(), pairs].concat()
    }

    #[test]
    fn metadata_records_of_the_input_are_recorded_as_such_and_not_as_messages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.mcap");
        let mut writer = LogWriter::create(&path, LogOptions::default()).unwrap();
        let mut channels = LogChannels::default();
        let metadata_channel =
            Channel { topic: "metadata".into(), message_encoding: "mcap_record".into(), ..Default::default() };
        let scan = Channel { topic: "/robot1/scan".into(), message_encoding: "cdr".into(), ..Default::default() };
        let mut write = |message: Message| channels.write(&message, &mut writer).unwrap();
        for (number, channel) in [(1, &metadata_channel), (2, &scan)] {
            assert!(!write(message(MessageFlags::CHANNEL, number, "", channel.encode().unwrap())));
        }
        assert!(!write(message(MessageFlags::DATA, 1, "metadata", metadata())));
        assert!(write(message(MessageFlags::DATA, 2, "/robot1/scan", b"scan".to_vec())));
        writer.finish(Outcome::Complete).unwrap();
        let file = LogFile::open(&path).unwrap();
        assert_eq!(file.metadata("drive").unwrap()["weather"], "rain");
        assert_eq!(file.statistics().unwrap().messages, 1);
        assert_eq!(channels.untyped, 0);
    }

    #[test]
    fn a_type_that_its_stage_defines_is_recorded_with_its_definition() {
        let channel = |definition: &str| {
            let definition = definition.to_owned();
            LogChannels { port_type: Some("rooms/msg/Room"), definition, ..LogChannels::default() }.channel(0, "/rooms")
        };
        assert!(channel("").is_none(), "no definition");
        assert_eq!(channel("string name\n").unwrap().schema, b"string name\n");
    }
}

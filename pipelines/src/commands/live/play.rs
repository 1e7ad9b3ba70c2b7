//! `gridweave play`: sends the messages of logs to a live pipeline at the pace at which they were logged.

use super::running::{RunChoice, Running, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::terminal::print_line;
use anyhow::{Context as _, Result, bail};
use clap::Args;
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::engine::{ExternalSender, SenderStopper};
use gridweave_runtime::message::{LogTime, MessageFlags, MessageHeader, Write};
use gridweave_runtime::stage::{Context, Node, OutputEnd, OutputSink, PortType, Registry, StageError};
use std::cell::RefCell;
use std::io;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Arguments of `gridweave play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// The logs: MCAP files, and folders of ROS 2 bags. Several are merged by log time.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// The rate relative to the recording; 0 is as fast as the pipeline takes the messages.
    #[arg(long, default_value_t = 1.0)]
    pub(crate) rate: f64,
    /// Repeat the logs with later log times until interrupted.
    #[arg(long = "loop")]
    pub(crate) repeat: bool,
    /// Seconds from the first message at which to begin. The last map of each robot before that is sent first.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    pub(crate) start: f64,
    /// Seconds from the first message at which to end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) end: Option<f64>,
    /// The stage to send as, if several stages of the pipeline take messages from outside.
    #[arg(long, value_name = "NAME")]
    pub(crate) stage: Option<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// The kind of source that reads logs.
const SOURCE: &str = "mcap_source";
/// Timeout for the stages of the run to connect, and to take the last messages.
const READY_TIMEOUT: Duration = Duration::from_secs(10);
/// While it waits, the player checks for an interrupt at this interval.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);
/// Between the last message and the first of the next repetition, nanoseconds.
const REPEAT_GAP: u64 = 100_000_000;

/// Plays logs.
pub(crate) fn play(args: &PlayArgs, registry: &Registry) -> Result<Status> {
    if !(args.rate.is_finite() && args.rate >= 0.0) {
        return Err(BadUse("--rate must be 0 or more".to_owned()).into());
    }
    let player = Player { args, registry, context: Context { stage: "play".to_owned(), ..Default::default() } };
    // Errors in the logs are reported before the search for a run.
    player.source(Vec::new())?;
    let running = find_run(&args.run, registry)?;
    let stage = external_stage(&running, args.stage.as_deref())?;
    let player = Player { context: running.pipeline.context(stage), ..player };
    let stop = stop_on_interrupt("no more messages are sent");
    let stopped = Arc::new(AtomicBool::new(false));
    let sender = ExternalSender::join(&running.run, &running.pipeline, stage)?;
    if !sender.wait_for_readers(READY_TIMEOUT) {
        bail!("the stages that read `{}` do not connect", running.pipeline.stages[stage].name);
    }
    let is_over = || stop.load(Ordering::Relaxed) || !running.run.is_running();
    let pace = Rc::new(RefCell::new(Pace::new(args.rate)));
    let links = || player.links(&running, stage, &sender, &pace);
    let result = watch_while(&is_over, &stopped, &sender.stopper(), || player.play_all(&links, &pace, &stopped));
    let result = result.context("cannot start a thread")?;
    let messages = pace.borrow().messages;
    match result {
        Err(_) if stopped.load(Ordering::Relaxed) => {}
        other => other?,
    }
    let is_taken = sender.wait_until_taken(READY_TIMEOUT);
    print_line(format_args!("played {messages} messages into {}", running.name()))?;
    if !running.run.is_running() {
        bail!("the run ended before the log did");
    }
    if !is_taken {
        bail!("the run has not taken the last messages within {} s", READY_TIMEOUT.as_secs());
    }
    Ok(Status::Done)
}

/// Finds the stage of a run that takes messages from outside.
fn external_stage(running: &Running, name: Option<&str>) -> Result<usize> {
    let stages = running.pipeline.stages.iter().enumerate();
    let external: Vec<(usize, &str)> = stages
        .filter(|(_, stage)| stage.kind.is_external())
        .map(|(index, stage)| (index, stage.name.as_str()))
        .collect();
    let names = || external.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(", ");
    match (name, external.as_slice()) {
        (_, []) => bail!("{} takes no messages from outside: it has no `live_source`", running.name()),
        (None, [(stage, _)]) => Ok(*stage),
        (None, _) => Err(BadUse(format!("choose one of the stages {} with --stage", names())).into()),
        (Some(name), _) => match external.iter().find(|(_, other)| *other == name) {
            Some((stage, _)) => Ok(*stage),
            None => Err(BadUse(format!("no stage `{name}` takes messages from outside; there are {}", names())).into()),
        },
    }
}

/// Does some work while another thread waits for `is_over`, and then sets `stopped` and stops the input stream.
///
/// # Errors
/// The thread cannot be started.
fn watch_while<T>(
    is_over: &(impl Fn() -> bool + Sync),
    stopped: &AtomicBool,
    sender: &SenderStopper,
    work: impl FnOnce() -> T,
) -> io::Result<T> {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let watch = || {
            while !done.load(Ordering::Relaxed) {
                if is_over() {
                    stopped.store(true, Ordering::Relaxed);
                    sender.stop();
                }
                thread::sleep(LOOK_INTERVAL);
            }
        };
        thread::Builder::new().spawn_scoped(scope, watch)?;
        let result = work();
        done.store(true, Ordering::Relaxed);
        Ok(result)
    })
}

struct Player<'a> {
    args: &'a PlayArgs,
    registry: &'a Registry,
    /// Robots and topics of the pipeline.
    context: Context,
}

impl Player<'_> {
    /// Makes a source that reads the logs from their beginning, and sends on these links.
    fn source(&self, links: Vec<OutputEnd>) -> Result<Node> {
        let mut parameters = toml::Table::new();
        let files = self.args.logs.iter().map(|path| {
            let text = path.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", path.display())))?;
            Ok(toml::Value::from(text))
        });
        parameters.insert("files".into(), files.collect::<Result<Vec<_>, BadUse>>()?.into());
        parameters.insert("start".into(), self.args.start.into());
        if let Some(end) = self.args.end {
            parameters.insert("end".into(), end.into());
        }
        let kind = self.registry.get(SOURCE).context("this program cannot read logs")?;
        Ok(kind.make(parameters, &self.context, links)?)
    }

    /// Makes the links of the source: each output leads to that of the same name of the stage that it sends as.
    fn links(
        &self,
        running: &Running,
        stage: usize,
        sender: &ExternalSender,
        pace: &Rc<RefCell<Pace>>,
    ) -> Result<Vec<OutputEnd>> {
        let kind = self.registry.get(SOURCE).context("this program cannot read logs")?;
        let spec = &running.pipeline.stages[stage];
        let links = kind.outputs.iter().map(|output| {
            let port = spec.kind.outputs.iter().position(|port| port.name == output.name);
            let link = port.and_then(|port| sender.output(port));
            let has_stamp = matches!(output.port_type, PortType::Ros(name) if begins_with_header(name));
            let paced = |link| -> Box<dyn OutputSink> { Box::new(Paced { pace: Rc::clone(pace), link, has_stamp }) };
            let sink = link.map(paced);
            OutputEnd { topic: port.and_then(|port| spec.topics.get(port)).cloned().unwrap_or_default(), sink }
        });
        Ok(links.collect())
    }

    fn play_all(
        &self,
        links: &dyn Fn() -> Result<Vec<OutputEnd>>,
        pace: &Rc<RefCell<Pace>>,
        stopped: &Arc<AtomicBool>,
    ) -> Result<()> {
        pace.borrow_mut().stopped = Arc::clone(stopped);
        loop {
            let mut source = self.source(links()?)?;
            while source.advance()? && !stopped.load(Ordering::Relaxed) {}
            // The warnings of a repetition are the same.
            for (warning, count) in source.warnings().iter().filter(|_| !pace.borrow().is_repeated()) {
                tracing::warn!("{count} times: {warning}");
            }
            if !self.args.repeat || stopped.load(Ordering::Relaxed) || !pace.borrow_mut().begin_repetition() {
                return Ok(());
            }
        }
    }
}

/// The time at which each message is sent.
struct Pace {
    rate: f64,
    start: Option<(Instant, LogTime)>,
    /// The first and the last log time of the logs.
    span: Option<(LogTime, LogTime)>,
    /// By how much the messages of this repetition are later than in the logs, nanoseconds.
    later: u64,
    /// The first channel number, so that those of several players differ.
    first_channel: u32,
    /// Number of messages sent.
    messages: u64,
    stopped: Arc<AtomicBool>,
}

impl Pace {
    fn new(rate: f64) -> Self {
        let first_channel = (std::process::id() & 0xf_ffff) << 12;
        Self { rate, start: None, span: None, later: 0, first_channel, messages: 0, stopped: Arc::default() }
    }

    /// Waits until it is time for a message.
    fn wait(&mut self, log_time: LogTime) -> Result<(), StageError> {
        let (first, last) = self.span.get_or_insert((log_time, log_time));
        (*first, *last) = ((*first).min(log_time), (*last).max(log_time));
        let shifted = LogTime(log_time.0.saturating_add(self.later));
        let (start, first) = *self.start.get_or_insert((Instant::now(), shifted));
        if self.rate > 0.0 {
            let after = Duration::try_from_secs_f64(shifted.seconds_since(first).max(0.0) / self.rate);
            let at = start + after.unwrap_or(Duration::MAX / 4);
            while let Some(left) = at.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
                self.check()?;
                thread::sleep(left.min(LOOK_INTERVAL));
            }
        }
        self.check()
    }

    fn check(&self) -> Result<(), StageError> {
        match self.stopped.load(Ordering::Relaxed) {
            true => Err(StageError::new("play on", "the player was stopped, or the run has ended")),
            false => Ok(()),
        }
    }

    /// Whether the logs are being repeated.
    fn is_repeated(&self) -> bool {
        self.later > 0
    }

    /// Starts a repetition. Returns `false` if the logs have no duration.
    fn begin_repetition(&mut self) -> bool {
        let Some((first, last)) = self.span.filter(|(first, last)| last > first) else { return false };
        self.later += last.0 - first.0 + REPEAT_GAP;
        true
    }
}

/// An output that sends each message at its time.
struct Paced {
    pace: Rc<RefCell<Pace>>,
    link: Box<dyn OutputSink>,
    /// Whether its messages begin with a header, whose stamp is shifted with them. Messages on a port of any type keep theirs.
    has_stamp: bool,
}

impl Paced {
    fn prepare(&self, header: &mut MessageHeader) -> Result<u64, StageError> {
        let mut pace = self.pace.borrow_mut();
        if header.flags.contains(MessageFlags::DATA) {
            pace.wait(header.log_time)?;
            pace.messages += 1;
        }
        header.log_time.0 = header.log_time.0.saturating_add(pace.later);
        header.publish_time = header.publish_time.saturating_add(pace.later);
        if header.channel != 0 {
            header.channel += pace.first_channel;
        }
        Ok(pace.later)
    }
}

impl OutputSink for Paced {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let has_stamp = self.has_stamp && header.flags.contains(MessageFlags::DATA);
        match self.prepare(&mut header)? {
            later if later > 0 && has_stamp => {
                let mut bytes = bytes.to_vec();
                make_later(&mut bytes, later);
                self.link.send(header, &bytes)
            }
            _ => self.link.send(header, bytes),
        }
    }

    fn send_in_place(&mut self, mut header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let (later, has_stamp) = (self.prepare(&mut header)?, self.has_stamp);
        self.link.send_in_place(header, &mut |blank| {
            let mut filled = write(blank)?;
            if has_stamp {
                make_later(&mut filled, later);
            }
            Ok(filled)
        })
    }
}

/// Whether the messages of a type have a header as their first field.
fn begins_with_header(type_name: &str) -> bool {
    let is_field = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let text = schema_text(type_name).unwrap_or_default();
    text.lines().map(str::trim).find(is_field).is_some_and(|field| field.starts_with("std_msgs/Header "))
}

/// Shifts the stamp of a message with a header, so that time does not go back for the stages. In CDR, the header follows the four
/// bytes of the encapsulation and begins with the stamp (seconds, nanoseconds).
fn make_later(bytes: &mut [u8], nanoseconds: u64) {
    let Some((seconds, nanos)) = bytes.get_mut(4..12).and_then(|stamp| stamp.split_first_chunk_mut::<4>()) else {
        return;
    };
    let Ok(nanos) = <&mut [u8; 4]>::try_from(nanos) else { return };
    let stamp = i64::from(i32::from_le_bytes(*seconds)) * 1_000_000_000 + i64::from(u32::from_le_bytes(*nanos));
    let later = stamp.saturating_add(i64::try_from(nanoseconds).unwrap_or(i64::MAX));
    *seconds = i32::try_from(later.div_euclid(1_000_000_000)).unwrap_or(i32::MAX).to_le_bytes();
    *nanos = u32::try_from(later.rem_euclid(1_000_000_000)).unwrap_or_default().to_le_bytes();
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, PoseStamped, decode, encode};

    #[test]
    fn the_stamp_is_shifted_and_nothing_else_changes() {
        let message = |time| PoseStamped { header: Header::new(LogTime(time), "robot1/map"), ..Default::default() };
        let mut bytes = encode(&message(1_999_999_999)).unwrap();
        make_later(&mut bytes, 1_000_000_002);
        assert_eq!(decode::<PoseStamped>(&bytes).unwrap(), message(3_000_000_001));
        make_later(&mut [1, 2, 3], 1);
    }

    #[test]
    fn the_messages_of_every_channel_are_shifted_in_a_repetition() {
        use gridweave_runtime::message::MessageHeader;
        use gridweave_runtime::ros::{OccupancyGrid, RosMessage, TFMessage, TagRange};

        struct Sent(Rc<RefCell<Vec<Vec<u8>>>>);
        impl OutputSink for Sent {
            fn send(&mut self, _: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
                self.0.borrow_mut().push(bytes.to_vec());
                Ok(())
            }

            fn send_in_place(&mut self, _: MessageHeader, _: &mut Write<'_>) -> Result<(), StageError> {
                Ok(())
            }
        }
        for name in [PoseStamped::NAME, OccupancyGrid::NAME, TagRange::NAME] {
            assert!(begins_with_header(name), "{name}");
        }
        assert!(!begins_with_header(TFMessage::NAME) && !begins_with_header("p/msg/Unknown"));

        let reading = |time| TagRange { header: Header::new(LogTime(time), "robot1"), ..Default::default() };
        let sent = Rc::default();
        let pace = Rc::new(RefCell::new(Pace { later: 7, ..Pace::new(0.0) }));
        let mut link = Paced { pace, link: Box::new(Sent(Rc::clone(&sent))), has_stamp: true };
        // Messages of a log have announced channels, and those that the source makes do not.
        for channel in [0, 3] {
            let flags = MessageFlags::DATA;
            let header = MessageHeader { channel, flags, log_time: LogTime(5), ..Default::default() };
            link.send(header, &encode(&reading(5)).unwrap()).unwrap();
        }
        for bytes in sent.borrow().iter() {
            assert_eq!(decode::<TagRange>(bytes).unwrap(), reading(12));
        }
        assert_eq!(sent.borrow().len(), 2);
    }

    #[test]
    fn rate_0_does_not_wait_and_repetitions_follow_each_other() {
        let mut pace = Pace::new(0.0);
        assert!(!pace.begin_repetition());
        for time in [5_000_000_000, 1_000_000_000, 9_000_000_000] {
            pace.wait(LogTime(time)).unwrap();
        }
        assert!(pace.begin_repetition());
        assert_eq!(pace.later, 8_000_000_000 + REPEAT_GAP);
        pace.stopped.store(true, Ordering::Relaxed);
        assert!(pace.wait(LogTime(1)).is_err());
    }
}

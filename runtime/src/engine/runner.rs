//! A running stage, independent of the kind of its links.
//!
//! It logs through `tracing`: its start and end at the level `info`, and each message as a span at the level `debug`.

use super::calls::Call;
use super::{Failure, StageReport};
use crate::link::{InputQueue, next_input};
use crate::message::{Channel, LogTime, Message, MessageFlags};
use crate::pipeline::{Pipeline, Wire};
use crate::stage::{Context, Node, OutputEnd, OutputSink, StageError};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// A running stage: its node and its report.
pub(super) struct Runner {
    node: Node,
    /// The input port of each wire.
    ports: Vec<usize>,
    /// The output that each wire comes from: STAGE.PORT.
    origins: Vec<String>,
    report: StageReport,
    /// The maximum memory of an input's pending messages of one log time, bytes.
    same_time_limit: u64,
}

impl Runner {
    /// Creates the stage with the given index of a pipeline. `sink` returns the sink of each of its output ports.
    pub(super) fn new(
        pipeline: &Pipeline,
        stage: usize,
        context: &Context,
        mut sink: impl FnMut(usize) -> Option<Box<dyn OutputSink>>,
    ) -> Result<Self, Failure> {
        let spec = &pipeline.stages[stage];
        let ends =
            spec.topics.iter().enumerate().map(|(port, topic)| OutputEnd { topic: topic.clone(), sink: sink(port) });
        let ends = ends.collect();
        let node = guarded(|| spec.kind.make(spec.parameters.clone(), context, ends))?;
        let report = StageReport { name: spec.name.clone(), kind: spec.kind.name.to_owned(), ..Default::default() };
        let origin = |wire: &Wire| {
            let from = &pipeline.stages[wire.from_stage];
            format!("{}.{}", from.name, from.kind.outputs[wire.from_port].name)
        };
        tracing::info!("stage {} ({}) starts", report.name, report.kind);
        Ok(Self {
            node,
            ports: spec.inputs.iter().map(|wire| wire.port).collect(),
            origins: spec.inputs.iter().map(origin).collect(),
            report,
            same_time_limit: pipeline.same_time_limit,
        })
    }

    /// Whether the stage is a source.
    pub(super) fn is_source(&self) -> bool {
        self.node.is_source()
    }

    /// Whether the stage is an external source: its messages come from outside of the run.
    pub(super) fn is_external(&self) -> bool {
        self.node.is_external()
    }

    /// Lets a source send its next messages. Returns `false` if there are no more, and for a stage that is no source.
    pub(super) fn advance(&mut self) -> Result<bool, Failure> {
        let _span = tracing::debug_span!("advance", stage = self.report.name).entered();
        let start = Instant::now();
        let more = guarded(|| self.node.advance());
        self.report.busy += start.elapsed();
        more
    }

    /// Lets a source wait until there is something to send, for at most `longest`.
    pub(super) fn wait(&mut self, longest: Duration) -> Result<(), Failure> {
        guarded(|| {
            self.node.wait(longest);
            Ok(())
        })
    }

    /// The number of warnings of the stage.
    pub(super) fn warnings(&self) -> u64 {
        self.node.warning_count()
    }

    /// Logs the warnings whose texts are new since the last call.
    pub(super) fn log_warnings(&self) {
        for what in self.node.take_unlogged() {
            tracing::warn!("{}: {what}", self.report.name);
        }
    }

    /// The share of its work that a source has done.
    pub(super) fn progress(&self) -> Result<Option<f64>, Failure> {
        guarded(|| Ok(self.node.progress()))
    }

    /// Passes the next message to the stage, if it is decided which one that is. Returns its wire.
    pub(super) fn handle_next(&mut self, queues: &mut [InputQueue]) -> Result<Option<usize>, Failure> {
        let Some(wire) = next_input(queues) else { return Ok(None) };
        let Some(message) = queues[wire].pop() else { return Ok(None) };
        self.take(wire, message).map(|()| Some(wire))
    }

    /// Checks the memory of messages that cannot be taken yet, although all have one log time: no watermark lies
    /// between them, so the credit of links does not limit how many there are.
    pub(super) fn check_pending(&self, queues: &[InputQueue]) -> Result<(), Failure> {
        let exceeds = |queue: &&InputQueue| queue.bytes() as u64 > self.same_time_limit && queue.has_single_log_time();
        let Some((queue, input)) = queues.iter().zip(&self.origins).find(|(queue, _)| exceeds(queue)) else {
            return Ok(());
        };
        Err(Failure::SameTime {
            input: input.clone(),
            messages: queue.len(),
            log_time: queue.bound().0,
            bytes: queue.bytes() as u64,
            limit: self.same_time_limit,
        })
    }

    /// Passes a message of the given wire to the stage.
    pub(super) fn take(&mut self, wire: usize, message: Message) -> Result<(), Failure> {
        let start = Instant::now();
        let result = self.handle(wire, &message);
        // The message is dropped within the measured time, as releasing its memory is work of this stage.
        drop(message);
        self.report.busy += start.elapsed();
        result
    }

    fn handle(&mut self, wire: usize, message: &Message) -> Result<(), Failure> {
        let header = message.header();
        self.node.set_log_time(self.node.log_time().max(header.log_time));
        if header.flags.contains(MessageFlags::CHANNEL) {
            return guarded(|| {
                let channel = Channel::decode(message.bytes())
                    .map_err(|error| StageError::new("read the announcement of a channel", error))?;
                self.node.announce(wire, header.channel, &channel)
            });
        }
        self.report.messages_in += 1;
        let (from, log_time) = (&self.origins[wire], header.log_time.0);
        let _span = tracing::debug_span!("receive", stage = self.report.name, from, log_time).entered();
        tracing::debug!("{} receives {} bytes of {from}", self.report.name, message.bytes().len());
        guarded(|| self.node.receive(self.ports[wire], message))
    }

    /// Notifies the stage that all its inputs have ended, at the log time `time`.
    pub(super) fn finish(&mut self, time: LogTime) -> Result<(), Failure> {
        self.node.set_log_time(self.node.log_time().max(time));
        let _span = tracing::debug_span!("finish", stage = self.report.name).entered();
        let start = Instant::now();
        let result = guarded(|| self.node.finish());
        self.report.busy += start.elapsed();
        result
    }

    /// Notifies the stage that the run has failed.
    pub(super) fn abort(&mut self, reason: &str) {
        let _call = Call::closing();
        // The run has failed already; a second failure during the cleanup would only hide the first.
        let _ = catch_unwind(AssertUnwindSafe(|| self.node.abort(reason)));
    }

    /// Drops the stage and returns its report. `waited` is the part of its working time that it spent waiting for
    /// others.
    pub(super) fn into_report(mut self, waited: Duration) -> Result<StageReport, Failure> {
        self.report.messages_out = self.node.messages_sent().sum();
        self.report.warnings = self.node.warnings();
        self.report.counts = self.node.counts();
        self.report.busy = self.report.busy.saturating_sub(waited);
        guarded(|| {
            drop(self.node);
            Ok(())
        })?;
        let StageReport { name, messages_in, messages_out, busy, .. } = &self.report;
        let seconds = busy.as_secs_f64();
        tracing::info!("stage {name} ends: {messages_in} messages in, {messages_out} out, {seconds:.3} s of work");
        Ok(self.report)
    }
}

/// Runs code of a stage, and turns a panic into a failure.
fn guarded<T>(work: impl FnOnce() -> Result<T, StageError>) -> Result<T, Failure> {
    let _call = Call::working();
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result.map_err(Failure::Stage),
        Err(panic) => Err(Failure::Panic(panic_text(&*panic))),
    }
}

pub(super) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without a text".to_owned())
}

/// The readers of each output port, as (reading stage, wire) by (stage, port).
pub(super) fn readers(pipeline: &Pipeline) -> BTreeMap<(usize, usize), Vec<(usize, usize)>> {
    let mut readers: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (stage, spec) in pipeline.stages.iter().enumerate() {
        for (wire, input) in spec.inputs.iter().enumerate() {
            readers.entry((input.from_stage, input.from_port)).or_default().push((stage, wire));
        }
    }
    readers
}

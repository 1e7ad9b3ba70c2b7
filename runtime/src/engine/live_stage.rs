//! One stage of a live pipeline with its links: takes messages as they arrive.

use super::live_links::{LiveLinks, SharedSender};
use super::runner::Runner;
use super::stage_thread::{Event, tell};
use super::{Failure, StageReport};
use crate::link::board::{StageBoard, StageNumber, StageState, WireNumber, monotonic_nanoseconds};
use crate::link::live::{LiveReceiver, Pause};
use crate::link::shared::{Activity, LinkError, Wake};
use crate::message::{LogTime, MessageFlags};
use iceoryx2::service::Service;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// A source looks so often whether its readers are connected.
const CONNECT_INTERVAL: Duration = Duration::from_millis(2);
/// A stage at its end looks so often whether its readers are still there.
const ACKNOWLEDGE_INTERVAL: Duration = Duration::from_millis(50);

/// One stage in its thread.
pub(super) struct LiveStage<'a, S: Service> {
    runner: Runner,
    receivers: Vec<LiveReceiver<S>>,
    senders: Vec<SharedSender<S>>,
    wake: Rc<Wake<S>>,
    board: StageBoard,
    /// Set when the run is to come to its end: sources send no more.
    drain: Arc<AtomicBool>,
    stage: usize,
    events: &'a Sender<Event>,
}

impl<'a, S: Service + 'static> LiveStage<'a, S> {
    /// Makes the ends of all links of the stage, and the stage.
    pub(super) fn connect(
        links: &LiveLinks<'_>,
        stage: usize,
        activity: Activity,
        drain: Arc<AtomicBool>,
        events: &'a Sender<Event>,
    ) -> Result<Self, Failure> {
        let LiveLinks { pipeline, plan, names, boards } = *links;
        let board = boards[stage].clone();
        board.set(StageNumber::Started, monotonic_nanoseconds());
        board.set(StageNumber::Process, u64::from(std::process::id()));
        board.set_state(StageState::Starting);
        let node = names.node::<S>()?;
        let name = &pipeline.stages[stage].name;
        let wake = Wake::new(&node, names, name, plan.stage_readers[stage], plan.peers[stage], activity)?;
        let receivers = links.receivers(&node, stage)?;
        let senders = links.senders(&node, stage, &Pause::Stage(Rc::clone(&wake)), true)?;
        let sink = |port: usize| Some(senders.get(port)?.as_ref()?.sink());
        let working = wake.working();
        let runner = Runner::new(pipeline, stage, sink)?;
        drop(working);
        board.set_state(StageState::Running);
        let senders = senders.into_iter().flatten().collect();
        Ok(Self { runner, receivers, senders, wake, board, drain, stage, events })
    }

    /// Runs the stage to its end and tells the run how it went.
    pub(super) fn run(mut self, stop_reason: &OnceLock<String>) {
        let (events, stage) = (self.events, self.stage);
        let result = match (self.runner.is_source(), self.runner.is_external()) {
            (true, _) => self.drive_source(),
            (_, true) => self.drive_external(),
            _ => self.drive_stage(),
        };
        match result {
            Ok(()) => tell(events, Event::Ended { stage, result: self.close() }),
            Err(failure) => {
                self.board.clear();
                let own_reason = failure.to_string();
                tell(events, Event::Ended { stage, result: Err(failure) });
                self.runner.abort(stop_reason.get().unwrap_or(&own_reason));
            }
        }
    }

    /// Drops the stage, and then acknowledges the end of its inputs.
    fn close(self) -> Result<StageReport, Failure> {
        let waited = self.senders.iter().map(|sender| sender.get().waited()).sum();
        let is_external = self.runner.is_external();
        let mut report = self.runner.into_report(waited)?;
        if is_external {
            report.messages_out = self.board.all_sent();
        }
        let dropped = (0..self.board.wires()).map(|wire| self.board.get_wire(wire, WireNumber::Dropped));
        report.dropped = dropped.sum();
        report.restarts = self.board.get(StageNumber::Restarts);
        if report.restarts > 0 {
            // With what the processes before this one have done.
            report.messages_in = self.board.get(StageNumber::MessagesIn);
            report.messages_out = self.board.all_sent();
            report.busy = Duration::from_nanos(self.board.get(StageNumber::Busy));
        }
        self.board.set_state(StageState::Ended);
        self.receivers.iter().for_each(LiveReceiver::acknowledge);
        Ok(report)
    }

    fn drive_source(&mut self) -> Result<(), Failure> {
        self.wait_for_readers()?;
        while !self.drain.load(Ordering::Relaxed) {
            self.begin_work();
            let working = self.wake.working();
            let more = self.runner.advance()?;
            drop(working);
            self.note_work();
            if !more {
                break;
            }
            self.wake.poll()?;
            self.repeat_for_new_readers()?;
        }
        self.end(self.runner.log_time())
    }

    /// Waits until every reader is connected, so that none misses the first messages.
    fn wait_for_readers(&self) -> Result<(), Failure> {
        while !self.drain.load(Ordering::Relaxed) && !self.senders.iter().all(|sender| sender.get().is_connected()) {
            self.wake.sleep_for(CONNECT_INTERVAL)?;
        }
        Ok(())
    }

    /// A source whose messages come from outside keeps the last of them for readers that come late.
    fn drive_external(&mut self) -> Result<(), Failure> {
        loop {
            self.wake.look_at_inputs()?;
            self.senders.iter().try_for_each(|sender| sender.get().look_at_all())?;
            self.repeat_for_new_readers()?;
            if self.drain.load(Ordering::Relaxed) {
                return self.end(LogTime::MIN);
            }
            self.wake.sleep_for_input()?;
        }
    }

    fn drive_stage(&mut self) -> Result<(), Failure> {
        loop {
            self.wake.look_at_inputs()?;
            while let Some(wire) = self.next_wire()? {
                self.handle(wire)?;
                self.wake.poll()?;
                if self.wake.has_news() {
                    break;
                }
            }
            self.receivers.iter_mut().try_for_each(LiveReceiver::connect)?;
            self.repeat_for_new_readers()?;
            if self.receivers.iter().all(LiveReceiver::is_done) {
                let time = self.receivers.iter().map(LiveReceiver::end_time).max().unwrap_or_default();
                self.begin_work();
                let working = self.wake.working();
                self.runner.finish(time)?;
                drop(working);
                self.note_work();
                return self.end(self.runner.log_time());
            }
            self.wake.sleep_for_input()?;
        }
    }

    /// The wire whose message was sent first, of those that have one.
    fn next_wire(&mut self) -> Result<Option<usize>, LinkError> {
        let mut first: Option<(u64, usize)> = None;
        for (wire, receiver) in self.receivers.iter_mut().enumerate() {
            if let Some(arrived) = receiver.head()?
                && first.is_none_or(|(sent_at, _)| arrived.sent_at < sent_at)
            {
                first = Some((arrived.sent_at, wire));
            }
        }
        Ok(first.map(|(_, wire)| wire))
    }

    fn handle(&mut self, wire: usize) -> Result<(), Failure> {
        let Some(arrived) = self.receivers[wire].take() else { return Ok(()) };
        let is_data = arrived.message.header().flags.contains(MessageFlags::DATA);
        self.begin_work();
        let working = self.wake.working();
        self.runner.take(wire, arrived.message)?;
        drop(working);
        self.note_work();
        if is_data {
            self.board.add(StageNumber::MessagesIn, 1);
            self.board.add_latency(monotonic_nanoseconds().saturating_sub(arrived.sent_at));
        }
        Ok(())
    }

    fn begin_work(&self) {
        self.board.set(StageNumber::WorkingSince, monotonic_nanoseconds());
    }

    fn note_work(&self) {
        let since = self.board.get(StageNumber::WorkingSince);
        self.board.add(StageNumber::Busy, monotonic_nanoseconds().saturating_sub(since));
        self.board.set(StageNumber::WorkingSince, 0);
        self.board.set(StageNumber::Warnings, self.runner.warnings());
    }

    fn repeat_for_new_readers(&self) -> Result<(), LinkError> {
        match self.wake.take_greetings() {
            true => self.senders.iter().try_for_each(|sender| sender.get().repeat()),
            false => Ok(()),
        }
    }

    /// Ends all links, and waits until every reader that is there has acknowledged it.
    fn end(&mut self, time: LogTime) -> Result<(), Failure> {
        self.senders.iter().try_for_each(|sender| sender.get().end(time))?;
        let acknowledged =
            |sender: &SharedSender<S>| sender.get().present_readers().all(|reader| self.wake.has_acknowledged(reader));
        while !self.senders.iter().all(acknowledged) {
            self.wake.sleep_for(ACKNOWLEDGE_INTERVAL)?;
        }
        Ok(())
    }
}

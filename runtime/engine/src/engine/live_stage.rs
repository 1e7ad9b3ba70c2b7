//! One stage of a live pipeline with its links: takes messages as they arrive.

use super::plan::Plan;
use super::runner::Runner;
use super::stage_thread::{Event, tell};
use super::{Failure, StageReport};
use crate::link::board::{StageBoard, StageNumber, StageState, monotonic_nanoseconds};
use crate::link::live::{LiveReader, LiveReceiver, LiveSender, Pause};
use crate::link::shared::{Activity, LinkError, RunNames, Wake, Waker};
use crate::message::{LogTime, MessageFlags, MessageHeader};
use crate::pipeline::Pipeline;
use crate::stage::{OutputSink, StageError};
use iceoryx2::node::Node;
use iceoryx2::service::Service;
use std::cell::RefCell;
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
    senders: Vec<Rc<RefCell<LiveSender<S>>>>,
    wake: Rc<Wake<S>>,
    board: StageBoard,
    /// Set when the run is to come to its end: sources send no more.
    drain: Arc<AtomicBool>,
    stage: usize,
    events: &'a Sender<Event>,
}

/// A sender that its stage and the end of the run share.
struct SharedSender<S: Service>(Rc<RefCell<LiveSender<S>>>);

impl<S: Service + 'static> OutputSink for SharedSender<S> {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.0.borrow_mut().send(header, bytes)
    }

    fn send_in_place(
        &mut self,
        header: MessageHeader,
        write: &mut dyn FnMut(&mut [u8]) -> Result<(), StageError>,
    ) -> Result<(), StageError> {
        self.0.borrow_mut().send_in_place(header, write)
    }
}

impl<'a, S: Service + 'static> LiveStage<'a, S> {
    /// Makes the ends of all links of the stage, and the stage.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn connect(
        pipeline: &Pipeline,
        plan: &Plan,
        names: &RunNames,
        stage: usize,
        boards: &[StageBoard],
        activity: Activity,
        drain: Arc<AtomicBool>,
        events: &'a Sender<Event>,
    ) -> Result<Self, Failure> {
        let spec = &pipeline.stages[stage];
        let board = boards[stage].clone();
        board.set(StageNumber::Started, monotonic_nanoseconds());
        board.set(StageNumber::Process, u64::from(std::process::id()));
        board.set_state(StageState::Starting);
        let node = names.node::<S>()?;
        let wake = Wake::new(&node, names, &spec.name, plan.stage_readers[stage], plan.peers[stage], activity)?;
        let receivers = spec.inputs.iter().enumerate().map(|(wire, input)| {
            let (from, port) = (input.from_stage, input.from_port);
            LiveReceiver::new(
                &node,
                names,
                &plan.shape(pipeline, from, port),
                wire,
                spec.depth,
                board.clone(),
                (boards[from].clone(), port),
                plan.waker(&node, names, pipeline, from)?,
                plan.reader_number(from, port, (stage, wire)),
                plan.stage_readers[from],
            )
        });
        let receivers = receivers.collect::<Result<Vec<_>, LinkError>>()?;
        let mut senders = Vec::new();
        let mut sinks: Vec<Option<Box<dyn OutputSink>>> = Vec::new();
        for port in 0..spec.kind.outputs.len() {
            if plan.readers(stage, port).is_empty() {
                sinks.push(None);
                continue;
            }
            let pause = Pause::Stage(Rc::clone(&wake));
            let sender = live_sender(pipeline, plan, names, &node, boards, (stage, port), pause, None)?;
            let sender = Rc::new(RefCell::new(sender));
            sinks.push(Some(Box::new(SharedSender(Rc::clone(&sender)))));
            senders.push(sender);
        }
        let sent = Runner::outputs(pipeline, stage, |port| sinks.get_mut(port).and_then(Option::take));
        let working = wake.working();
        let runner = Runner::new(pipeline, stage, sent)?;
        drop(working);
        board.set_state(StageState::Running);
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
        let waited = self.senders.iter().map(|sender| sender.borrow().waited()).sum();
        let is_external = self.runner.is_external();
        let mut report = self.runner.into_report(waited)?;
        if is_external {
            report.messages_out = self.board.all_sent();
        }
        let dropped =
            (0..self.board.wires()).map(|wire| self.board.get_wire(wire, crate::link::board::WireNumber::Dropped));
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
        while !self.drain.load(Ordering::Relaxed) && !self.senders.iter().all(|sender| sender.borrow().is_connected()) {
            self.wake.sleep_for(CONNECT_INTERVAL)?;
        }
        Ok(())
    }

    /// A source whose messages come from outside keeps the last of them for readers that come late.
    fn drive_external(&mut self) -> Result<(), Failure> {
        loop {
            self.wake.look_at_inputs()?;
            self.senders.iter().try_for_each(|sender| sender.borrow_mut().look_at_all())?;
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
            true => self.senders.iter().try_for_each(|sender| sender.borrow_mut().repeat()),
            false => Ok(()),
        }
    }

    /// Ends all links, and waits until every reader that is there has acknowledged it.
    fn end(&mut self, time: LogTime) -> Result<(), Failure> {
        self.senders.iter().try_for_each(|sender| sender.borrow_mut().end(time))?;
        let acknowledged = |sender: &Rc<RefCell<LiveSender<S>>>| {
            sender.borrow().present_readers().all(|reader| self.wake.has_acknowledged(reader))
        };
        while !self.senders.iter().all(acknowledged) {
            self.wake.sleep_for(ACKNOWLEDGE_INTERVAL)?;
        }
        Ok(())
    }
}

/// A sender of the link that is an output port of a stage: its owner or, if it is told how to wake that, a program outside
/// of the run.
#[allow(clippy::too_many_arguments)]
pub(super) fn live_sender<S: Service + 'static>(
    pipeline: &Pipeline,
    plan: &Plan,
    names: &RunNames,
    node: &Node<S>,
    boards: &[StageBoard],
    (stage, port): (usize, usize),
    pause: Pause<S>,
    owner: Option<Waker<S>>,
) -> Result<LiveSender<S>, LinkError> {
    let readers = plan.readers(stage, port).iter().map(|&(reader, wire)| {
        Ok(LiveReader {
            waker: plan.waker(node, names, pipeline, reader)?,
            board: boards[reader].clone(),
            wire,
            depth: pipeline.stages[reader].depth,
            number: plan.reader_number(stage, port, (reader, wire)),
        })
    });
    let readers = readers.collect::<Result<Vec<_>, LinkError>>()?;
    let shape = plan.shape(pipeline, stage, port);
    LiveSender::new(node, names, &shape, readers, pause, boards[stage].clone(), port, owner)
}

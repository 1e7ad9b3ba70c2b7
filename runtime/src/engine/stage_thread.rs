//! One stage with its links over shared memory: receives, handles, sends, sleeps.

use super::plan::Plan;
use super::runner::Runner;
use super::{Failure, StageReport};
use crate::link::board::{StageBoard, StageNumber, StageState, WireNumber, monotonic_nanoseconds};
use crate::link::shared::{Activity, LinkError, LinkReceiver, LinkSender, RunNames, SenderEnd, SharedOutputs, Wake};
use crate::link::{InputQueue, latest, lower_bound};
use crate::message::LogTime;
use crate::pipeline::Pipeline;
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::OnceLock;
use std::sync::mpsc::Sender;

/// What a stage's thread tells the run.
pub(super) enum Event {
    /// A source has done a share of its work.
    Progress { stage: usize, share: f64, log_time: LogTime },
    /// A live run is to come to its end.
    Drain,
    /// The run is to be stopped.
    Stop { reason: String },
    /// The stage is done, or has failed.
    Ended { stage: usize, result: Result<StageReport, Failure> },
}

/// Tells the run something. It listens until all stages have ended.
pub(super) fn tell(events: &Sender<Event>, event: Event) {
    let _ = events.send(event);
}

/// One stage in its thread.
pub(super) struct StageThread<'a, S: Service> {
    runner: Runner,
    queues: Vec<InputQueue>,
    receivers: Vec<LinkReceiver<S>>,
    outputs: Rc<RefCell<SharedOutputs<S>>>,
    wake: Rc<Wake<S>>,
    stage: usize,
    /// After so many samples, the readers are told how far the stage is.
    flush_interval: usize,
    /// What the stage shows of itself, in a run of processes.
    board: Option<StageBoard>,
    events: &'a Sender<Event>,
}

impl<'a, S: Service + 'static> StageThread<'a, S> {
    /// Runs the stage to its end and tells the run how it went.
    pub(super) fn run(mut self, stop_reason: &OnceLock<String>) {
        let (events, stage) = (self.events, self.stage);
        let result = match self.runner.is_source() {
            true => self.drive_source(),
            false => self.drive_stage(),
        };
        match result {
            Ok(()) => tell(events, Event::Ended { stage, result: self.close() }),
            Err(failure) => {
                // Told before the links go, so that the peers' complaints about lost links come after the cause.
                let own_reason = failure.to_string();
                tell(events, Event::Ended { stage, result: Err(failure) });
                self.runner.abort(stop_reason.get().unwrap_or(&own_reason));
            }
        }
    }

    /// Drops the stage, and then acknowledges the end of its inputs: it holds nothing of them any more.
    fn close(self) -> Result<StageReport, Failure> {
        let waited = self.outputs.borrow().waited();
        self.show();
        if let Some(board) = &self.board {
            board.set_state(StageState::Ended);
        }
        let report = self.runner.into_report(waited)?;
        drop(self.queues);
        self.receivers.iter().try_for_each(LinkReceiver::acknowledge)?;
        Ok(report)
    }

    /// Makes the ends of all links of the stage, and the stage.
    pub(super) fn connect(
        pipeline: &Pipeline,
        plan: &Plan,
        names: &RunNames,
        stage: usize,
        activity: Activity,
        board: Option<StageBoard>,
        events: &'a Sender<Event>,
    ) -> Result<Self, Failure> {
        let spec = &pipeline.stages[stage];
        if let Some(board) = &board {
            board.set(StageNumber::Process, u64::from(std::process::id()));
            board.set(StageNumber::Started, monotonic_nanoseconds());
            board.set_state(StageState::Running);
        }
        let node = names.node::<S>()?;
        let wake = Wake::new(&node, names, &spec.name, plan.stage_readers[stage], plan.peers[stage], activity)?;
        let mut receivers = Vec::new();
        for (wire, input) in spec.inputs.iter().enumerate() {
            let (from, port) = (input.from_stage, input.from_port);
            let sender = SenderEnd {
                stage: &pipeline.stages[from].name,
                port: pipeline.stages[from].kind.outputs[port].name,
                port_readers: plan.readers(from, port).len(),
                port_depth: plan.port_depth(pipeline, from, port),
                stage_readers: plan.stage_readers[from],
                reader: plan.reader_number(from, port, (stage, wire)),
                waker: plan.waker(&node, names, pipeline, from)?,
            };
            receivers.push(LinkReceiver::new(&node, names, sender, wire, spec.depth)?);
        }
        let mut senders = Vec::new();
        let mut places = vec![None; spec.kind.outputs.len()];
        for (port, place) in places.iter_mut().enumerate() {
            let readers = plan.readers(stage, port);
            if readers.is_empty() {
                continue;
            }
            let ends = readers.iter().map(|&reader| {
                let number = plan.reader_number(stage, port, reader);
                Ok((number, plan.waker(&node, names, pipeline, reader.0)?))
            });
            let ends = ends.collect::<Result<Vec<_>, LinkError>>()?;
            let depth = plan.port_depth(pipeline, stage, port);
            let name = spec.kind.outputs[port].name;
            *place = Some(senders.len());
            senders.push(LinkSender::new(
                &node,
                names,
                &spec.name,
                name,
                depth,
                Rc::clone(&wake),
                ends,
                pipeline.batch,
            )?);
        }
        let outputs = SharedOutputs::new(senders, Rc::clone(&wake));
        let sink = |port: usize| places.get(port).copied().flatten().map(|link| SharedOutputs::sink(&outputs, link));
        let working = wake.working();
        let runner = Runner::new(pipeline, stage, sink)?;
        drop(working);
        let queues = spec.inputs.iter().map(|_| InputQueue::default()).collect();
        let flush_interval = (spec.depth / 2).max(1);
        Ok(Self { runner, queues, receivers, outputs, wake, stage, flush_interval, board, events })
    }

    fn drive_source(&mut self) -> Result<(), Failure> {
        /// After so many messages a source tells how far it is.
        const REPORT_INTERVAL: usize = 256;
        let mut count = 0;
        loop {
            let working = self.wake.working();
            if !self.runner.advance()? {
                break;
            }
            drop(working);
            count += 1;
            if count % REPORT_INTERVAL == 0 {
                self.wake.poll()?;
                let reached = self.outputs.borrow().reached();
                self.outputs.borrow_mut().flush(reached)?;
                self.show();
                if let Some(share) = self.runner.progress()? {
                    tell(self.events, Event::Progress { stage: self.stage, share, log_time: reached });
                }
            }
        }
        let mut outputs = self.outputs.borrow_mut();
        let reached = outputs.reached();
        Ok(outputs.end(reached)?)
    }

    fn drive_stage(&mut self) -> Result<(), Failure> {
        loop {
            self.wake.look_at_inputs()?;
            self.receive()?;
            let mut handled = 0;
            loop {
                let working = self.wake.working();
                let Some(wire) = self.runner.handle_next(&mut self.queues)? else { break };
                drop(working);
                if !self.receivers[wire].taken()? {
                    continue;
                }
                handled += 1;
                if handled % self.flush_interval == 0 {
                    // Looks for a stop, too: a stage whose input never dries up would not see it otherwise.
                    self.wake.poll()?;
                    self.receive()?;
                    self.flush()?;
                    self.show();
                }
            }
            if self.queues.iter().all(InputQueue::is_done) {
                let time = latest(&self.queues);
                let working = self.wake.working();
                self.runner.finish(time)?;
                drop(working);
                return Ok(self.outputs.borrow_mut().end(time)?);
            }
            self.flush()?;
            for (receiver, queue) in self.receivers.iter_mut().zip(&self.queues) {
                receiver.relieve(queue)?;
            }
            self.show();
            self.wake.sleep_for_input()?;
        }
    }

    /// Shows on the board how far the stage is.
    fn show(&self) {
        let Some(board) = &self.board else { return };
        self.runner.show(self.outputs.borrow().waited(), board);
        for (wire, queue) in self.queues.iter().enumerate() {
            board.set_wire(wire, WireNumber::Waiting, queue.len() as u64);
        }
    }

    fn receive(&mut self) -> Result<(), LinkError> {
        for (receiver, queue) in self.receivers.iter_mut().zip(&mut self.queues) {
            if receiver.connect()? {
                receiver.receive(queue)?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), LinkError> {
        match lower_bound(&self.queues) {
            Some(watermark) => self.outputs.borrow_mut().flush(watermark),
            None => Ok(()),
        }
    }
}

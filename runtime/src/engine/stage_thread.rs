//! One stage with its links over shared memory: receives, handles, sends, sleeps.

use super::links::Links;
use super::runner::Runner;
use super::statistics::run_statistics;
use super::work_timer::WorkTimer;
use super::{Failure, StageReport};
use crate::link::{
    Control, InputQueue, LinkError, LinkReceiver, Order, Outputs, SenderRole, Sleeper, latest, lower_bound,
};
use crate::link::{StageCounters, StageCounter, StageState, WireCounter, monotonic_nanoseconds};
use crate::message::{LogTime, MessageFlags};
use crate::stage::Context;
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::mpsc::Sender;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// After so many messages a source tells how far it is.
const REPORT_INTERVAL: usize = 256;

/// A source of a live run that has nothing to send sees so often whether it is to end, or somebody has come to read.
const SOURCE_WAIT: Duration = Duration::from_millis(50);

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
    outputs: Rc<RefCell<Outputs<S>>>,
    sleeper: Rc<Sleeper>,
    counters: StageCounters,
    work: WorkTimer,
    order: Order,
    /// After so many samples the stage looks at its links, and tells its readers how far it is.
    look_interval: usize,
    stage: usize,
    events: &'a Sender<Event>,
}

impl<'a, S: Service + 'static> StageThread<'a, S> {
    /// Makes the stage, runs it to its end, and tells the run how it went.
    pub(super) fn start(
        links: &Links<'_>,
        stage: usize,
        control: Arc<Control>,
        stop_reason: &OnceLock<String>,
        events: &'a Sender<Event>,
    ) {
        match Self::connect(links, stage, control, events) {
            Ok(thread) => thread.run(stop_reason),
            Err(failure) => {
                links.counters.stage(stage).clear();
                tell(events, Event::Ended { stage, result: Err(failure) });
            }
        }
    }

    /// Makes the ends of all links of the stage, and the stage.
    fn connect(
        links: &Links<'_>,
        stage: usize,
        control: Arc<Control>,
        events: &'a Sender<Event>,
    ) -> Result<Self, Failure> {
        let (pipeline, counters) = (links.pipeline, links.counters.stage(stage));
        let spec = &pipeline.stages[stage];
        counters.set(StageCounter::Started, monotonic_nanoseconds());
        counters.set(StageCounter::Process, u64::from(std::process::id()));
        counters.set_state(StageState::Starting);
        let sleeper = Rc::new(Sleeper::new(counters.clone(), control));
        let node = links.node::<S>()?;
        let receivers = links.receivers(&node, stage)?;
        let role = if spec.kind.is_external() { SenderRole::PassiveOwner } else { SenderRole::Owner };
        let (ports, senders): (Vec<usize>, Vec<_>) = links.senders(&node, stage, role)?.into_iter().unzip();
        let outputs = Outputs::new(senders, Rc::clone(&sleeper));
        let sink = |port: usize| Some(Outputs::sink(&outputs, ports.binary_search(&port).ok()?));
        let mut work = WorkTimer::new(counters.clone(), Rc::clone(&sleeper));
        work.begin();
        let statistics = Some(run_statistics(pipeline, links.counters));
        let context = Context { statistics, links: links.to_look_on(), ..pipeline.context(stage) };
        let runner = Runner::new(pipeline, stage, &context, sink)?;
        work.note();
        work.end();
        counters.set_state(StageState::Running);
        let order = Order::from(pipeline.mode);
        let queues = spec.inputs.iter().map(|_| InputQueue::default()).collect();
        let look_interval = match order {
            Order::LogTime => (spec.depth / 2).max(1),
            // The next may be one that has just come.
            Order::Arrival => 1,
        };
        Ok(Self { runner, queues, receivers, outputs, sleeper, counters, work, order, look_interval, stage, events })
    }

    /// Runs the stage to its end and tells the run how it went.
    fn run(mut self, stop_reason: &OnceLock<String>) {
        let (events, stage) = (self.events, self.stage);
        let result = match (self.runner.is_source(), self.runner.is_external()) {
            (true, _) => self.drive_source(),
            (_, true) => self.drive_external(),
            _ => self.drive_stage(),
        };
        match result {
            Ok(()) => tell(events, Event::Ended { stage, result: self.close() }),
            Err(failure) => {
                self.counters.clear();
                // Told before the links go, so that the peers' complaints about lost links come after the cause.
                let own_reason = failure.to_string();
                tell(events, Event::Ended { stage, result: Err(failure) });
                self.runner.abort(stop_reason.get().unwrap_or(&own_reason));
            }
        }
    }

    /// Drops the stage and all that it holds of its inputs, and so acknowledges their end.
    fn close(self) -> Result<StageReport, Failure> {
        self.show();
        let is_external = self.runner.is_external();
        let mut report = self.runner.into_report(self.sleeper.waited())?;
        drop(self.queues);
        let dropped = (0..self.counters.wires()).map(|wire| self.counters.get_wire(wire, WireCounter::Dropped));
        report.dropped = dropped.sum();
        report.restarts = self.counters.get(StageCounter::Restarts);
        if is_external || report.restarts > 0 {
            // With what the processes before this one have done.
            report.messages_in = self.counters.get(StageCounter::MessagesIn);
            report.messages_out = self.counters.all_sent();
            report.busy = Duration::from_nanos(self.counters.get(StageCounter::Busy));
        }
        self.counters.set_state(StageState::Ended);
        Ok(report)
    }

    fn drive_source(&mut self) -> Result<(), Failure> {
        let sleeper = Rc::clone(&self.sleeper);
        // So that none misses the first messages.
        let is_connected = || self.outputs.borrow_mut().links().iter().all(|link| link.is_connected());
        sleeper.wait(|| Ok(sleeper.control().is_draining() || is_connected()))?;
        let mut count = 0;
        while !sleeper.control().is_draining() {
            if self.order == Order::Arrival {
                self.work.end();
                let reached = self.outputs.borrow().reached();
                self.outputs.borrow_mut().flush(reached)?;
                self.show();
                self.runner.wait(SOURCE_WAIT)?;
            }
            self.work.begin();
            let more = self.runner.advance()?;
            self.work.note();
            if !more {
                break;
            }
            self.look()?;
            count += 1;
            if count % REPORT_INTERVAL == 0 {
                self.report_progress()?;
            }
        }
        if sleeper.control().is_draining() {
            let reached = self.outputs.borrow().reached();
            self.runner.finish(reached)?;
        }
        self.work.end();
        let reached = self.outputs.borrow().reached();
        Ok(self.outputs.borrow_mut().end(reached)?)
    }

    fn report_progress(&mut self) -> Result<(), Failure> {
        let reached = self.outputs.borrow().reached();
        self.outputs.borrow_mut().flush(reached)?;
        self.show();
        if let Some(share) = self.runner.progress()? {
            tell(self.events, Event::Progress { stage: self.stage, share, log_time: reached });
        }
        Ok(())
    }

    /// A source whose messages come from outside keeps the last of them for readers that come late.
    fn drive_external(&mut self) -> Result<(), Failure> {
        loop {
            self.outputs.borrow_mut().ingest()?;
            self.look()?;
            if self.sleeper.control().is_draining() {
                let reached = self.outputs.borrow().reached();
                return Ok(self.outputs.borrow_mut().end(reached)?);
            }
            self.sleep()?;
        }
    }

    fn drive_stage(&mut self) -> Result<(), Failure> {
        loop {
            self.look()?;
            self.receive()?;
            self.handle_all()?;
            if self.queues.iter().all(InputQueue::is_done) {
                let time = latest(&self.queues);
                self.work.begin();
                self.runner.finish(time)?;
                self.work.note();
                self.work.end();
                return Ok(self.outputs.borrow_mut().end(time)?);
            }
            self.flush()?;
            for (receiver, queue) in self.receivers.iter_mut().zip(&self.queues) {
                receiver.extend_credit(queue);
            }
            self.show();
            self.receivers.iter_mut().for_each(LinkReceiver::ring_for_credit);
            self.sleep()?;
        }
    }

    /// Handles the messages that are there, as far as it can be told which is the next.
    fn handle_all(&mut self) -> Result<(), Failure> {
        let mut handled = 0;
        while let Some(wire) = self.order.next(&self.queues) {
            let Some(message) = self.queues[wire].pop() else { break };
            let is_data = message.header().flags.contains(MessageFlags::DATA);
            self.work.begin();
            self.runner.take(wire, message)?;
            let time = self.work.note();
            if is_data {
                self.counters.add(StageCounter::MessagesIn, 1);
                if self.order == Order::Arrival {
                    self.counters.add_latency(time.saturating_sub(self.queues[wire].sent_at()));
                }
            }
            handled += usize::from(self.receivers[wire].record_taken());
            if handled >= self.look_interval {
                handled = 0;
                // A stage whose input never dries up would not see a stop otherwise.
                self.look()?;
                self.receive()?;
                self.flush()?;
                self.show();
            }
        }
        self.work.end();
        Ok(())
    }

    /// Sees whether the run is being stopped, or somebody has come who is to be sent what he has missed.
    fn look(&self) -> Result<(), LinkError> {
        self.sleeper.check()?;
        self.outputs.borrow_mut().answer_history_requests()
    }

    /// Sleeps until there is something to receive or to send.
    fn sleep(&self) -> Result<(), LinkError> {
        let watermark = lower_bound(&self.queues);
        self.sleeper.wait(|| {
            let mut outputs = self.outputs.borrow_mut();
            if outputs.has_history_requests()
                || outputs.has_ingest_requests()
                || watermark.is_some_and(|watermark| outputs.can_flush(watermark))
            {
                return Ok(true);
            }
            for link in outputs.links() {
                if link.has_pending()? {
                    return Ok(true);
                }
            }
            for (receiver, queue) in self.receivers.iter().zip(&self.queues) {
                if receiver.has_pending(queue)? {
                    return Ok(true);
                }
            }
            Ok(self.receivers.is_empty() && self.sleeper.control().is_draining())
        })
    }

    /// Shows on the counters how far the stage is.
    fn show(&self) {
        self.counters.set(StageCounter::Warnings, self.runner.warnings());
        for (wire, queue) in self.queues.iter().enumerate() {
            self.counters.set_wire(wire, WireCounter::Waiting, queue.len() as u64);
        }
    }

    fn receive(&mut self) -> Result<(), LinkError> {
        self.receivers.iter_mut().zip(&mut self.queues).try_for_each(|(receiver, queue)| receiver.receive(queue))
    }

    fn flush(&self) -> Result<(), LinkError> {
        match lower_bound(&self.queues) {
            Some(watermark) => self.outputs.borrow_mut().flush(watermark),
            None => Ok(()),
        }
    }
}

//! A stage with its links over shared memory: receives, handles, sends, sleeps.

use super::links::Links;
use super::runner::{Runner, panic_text};
use super::statistics::run_statistics;
use super::work_timer::WorkTimer;
use super::{Failure, StageReport};
use crate::link::{
    Control, InputQueue, LinkError, LinkReceiver, Order, Outputs, SenderRole, Sleeper, latest, lower_bound,
};
use crate::link::{StageCounter, StageCounters, StageState, WireCounter, monotonic_nanoseconds};
use crate::message::{LogTime, MessageFlags};
use crate::stage::Context;
use iceoryx2::service::Service;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::mpsc::Sender;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// The number of times that a source advances between two reports of its progress.
const REPORT_INTERVAL: usize = 256;

/// The interval at which an idle source of a live run checks for a drain and for late joiners.
const SOURCE_WAIT: Duration = Duration::from_millis(50);

/// An event of a stage's thread, or a command to it.
pub(super) enum Event {
    /// The progress of a source.
    Progress { stage: usize, share: f64, log_time: LogTime },
    /// The end of a live run was requested.
    Drain,
    /// The stop of the run was requested.
    Stop { reason: String },
    /// The stage has finished or failed.
    Ended { stage: usize, result: Result<StageReport, Failure> },
}

/// Sends an event to the run, which receives events until all stages have ended.
pub(super) fn send_event(events: &Sender<Event>, event: Event) {
    let _ = events.send(event);
}

/// A stage in its thread.
pub(super) struct StageThread<'a, S: Service> {
    runner: Runner,
    queues: Vec<InputQueue>,
    receivers: Vec<LinkReceiver<S>>,
    outputs: Rc<RefCell<Outputs<S>>>,
    sleeper: Rc<Sleeper>,
    counters: StageCounters,
    work: WorkTimer,
    order: Order,
    /// The number of handled samples after which the stage receives, sends watermarks and checks for requests.
    check_interval: usize,
    stage: usize,
    events: &'a Sender<Event>,
}

impl<'a, S: Service + 'static> StageThread<'a, S> {
    /// Creates the stage, runs it to its end, and sends the result to the run.
    pub(super) fn start(
        links: &Links<'_>,
        stage: usize,
        control: Arc<Control>,
        stop_reason: &OnceLock<String>,
        events: &'a Sender<Event>,
    ) {
        let has_ended = Cell::new(false);
        let end = |result: Result<StageReport, Failure>| {
            if result.is_err() {
                links.counters.stage(stage).clear();
            }
            if !has_ended.replace(true) {
                send_event(events, Event::Ended { stage, result });
            }
        };
        let run = || match Self::connect(links, stage, control, events) {
            Ok(thread) => thread.run(stop_reason, &end),
            Err(failure) => end(Err(failure)),
        };
        // A link may panic, too. The run must hear of it: it waits for the end of every stage.
        if let Err(panic) = catch_unwind(AssertUnwindSafe(run)) {
            end(Err(Failure::Panic(panic_text(&*panic))));
        }
    }

    /// Creates the ends of all links of the stage, and the stage.
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
        let context = Context { statistics, links: links.observable(), ..pipeline.context(stage) };
        let runner = Runner::new(pipeline, stage, &context, sink)?;
        work.finish_message();
        work.end();
        counters.set_state(StageState::Running);
        let order = Order::from(pipeline.mode);
        let queues = spec.inputs.iter().map(|_| InputQueue::default()).collect();
        let check_interval = match order {
            Order::LogTime => (spec.depth / 2).max(1),
            // The next message may be one that has just arrived.
            Order::Arrival => 1,
        };
        Ok(Self { runner, queues, receivers, outputs, sleeper, counters, work, order, check_interval, stage, events })
    }

    /// Runs the stage to its end and sends the result to the run.
    fn run(mut self, stop_reason: &OnceLock<String>, end: &dyn Fn(Result<StageReport, Failure>)) {
        let result = match (self.runner.is_source(), self.runner.is_external()) {
            (true, _) => self.drive_source(),
            (_, true) => self.drive_external(),
            _ => self.drive_stage(),
        };
        match result {
            Ok(()) => end(self.close()),
            Err(failure) => {
                // Sent before the links are dropped, so that the errors of peers about lost links follow the cause.
                let own_reason = failure.to_string();
                end(Err(failure));
                self.runner.abort(stop_reason.get().unwrap_or(&own_reason));
            }
        }
    }

    /// Drops the stage and all samples that it borrows, and so acknowledges the end of its inputs.
    fn close(self) -> Result<StageReport, Failure> {
        self.update_counters();
        let is_external = self.runner.is_external();
        let mut report = self.runner.into_report(self.sleeper.waited())?;
        drop(self.queues);
        let dropped = (0..self.counters.wires()).map(|wire| self.counters.get_wire(wire, WireCounter::Dropped));
        report.dropped = dropped.sum();
        report.restarts = self.counters.get(StageCounter::Restarts);
        if is_external || report.restarts > 0 {
            // The counters include the work of the processes before this one.
            report.messages_in = self.counters.get(StageCounter::MessagesIn);
            report.messages_out = self.counters.all_sent();
            report.busy = Duration::from_nanos(self.counters.get(StageCounter::Busy));
        }
        self.counters.set_state(StageState::Ended);
        Ok(report)
    }

    fn drive_source(&mut self) -> Result<(), Failure> {
        let sleeper = Rc::clone(&self.sleeper);
        // Wait for all readers, so that none misses the first messages.
        let is_connected = || self.outputs.borrow_mut().links().iter().all(|link| link.is_connected());
        sleeper.wait(|| Ok(sleeper.control().is_draining() || is_connected()))?;
        let mut count = 0;
        while !sleeper.control().is_draining() {
            if self.order == Order::Arrival {
                self.work.end();
                let reached = self.outputs.borrow().reached();
                self.outputs.borrow_mut().flush(reached)?;
                self.update_counters();
                self.runner.wait(SOURCE_WAIT)?;
            }
            self.work.begin();
            let more = self.runner.advance()?;
            self.work.finish_message();
            if !more {
                break;
            }
            self.check_requests()?;
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
        self.update_counters();
        if let Some(share) = self.runner.progress()? {
            send_event(self.events, Event::Progress { stage: self.stage, share, log_time: reached });
        }
        Ok(())
    }

    /// Runs an external source, which only retains the history of its links for late joiners.
    fn drive_external(&mut self) -> Result<(), Failure> {
        loop {
            self.outputs.borrow_mut().ingest()?;
            self.check_requests()?;
            if self.sleeper.control().is_draining() {
                let reached = self.outputs.borrow().reached();
                return Ok(self.outputs.borrow_mut().end(reached)?);
            }
            self.sleep()?;
        }
    }

    fn drive_stage(&mut self) -> Result<(), Failure> {
        loop {
            self.check_requests()?;
            self.receive()?;
            self.handle_all()?;
            if self.queues.iter().all(InputQueue::is_done) {
                let time = latest(&self.queues);
                self.work.begin();
                self.runner.finish(time)?;
                self.work.finish_message();
                self.work.end();
                return Ok(self.outputs.borrow_mut().end(time)?);
            }
            self.flush()?;
            self.runner.check_pending(&self.queues)?;
            for (receiver, queue) in self.receivers.iter_mut().zip(&self.queues) {
                receiver.extend_credit(queue);
            }
            self.update_counters();
            self.receivers.iter_mut().for_each(LinkReceiver::ring_for_credit);
            self.sleep()?;
        }
    }

    /// Handles the pending messages, as far as it is decided which one is next.
    fn handle_all(&mut self) -> Result<(), Failure> {
        let mut handled = 0;
        while let Some(wire) = self.order.next(&self.queues) {
            let Some(message) = self.queues[wire].pop() else { break };
            let is_data = message.header().flags.contains(MessageFlags::DATA);
            self.work.begin();
            self.runner.take(wire, message)?;
            let time = self.work.finish_message();
            if is_data {
                self.counters.add(StageCounter::MessagesIn, 1);
                if self.order == Order::Arrival {
                    self.counters.add_latency(time.saturating_sub(self.queues[wire].sent_at()));
                }
            }
            handled += usize::from(self.receivers[wire].record_taken());
            if handled >= self.check_interval {
                handled = 0;
                // A stage with a steady input would not notice a stop otherwise.
                self.check_requests()?;
                self.receive()?;
                self.flush()?;
                self.update_counters();
            }
        }
        self.work.end();
        Ok(())
    }

    /// Checks whether the run is being stopped, and answers requests for the history.
    fn check_requests(&self) -> Result<(), LinkError> {
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

    /// Publishes the progress of the stage in its counters, and in a live run its warnings in the log: nobody waits for the
    /// summary.
    fn update_counters(&self) {
        if self.order == Order::Arrival {
            self.runner.log_warnings();
        }
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

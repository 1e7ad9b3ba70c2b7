//! The engine `threads`: a thread a stage, with links over shared memory.

use super::runner::{Runner, readers};
use super::{Failure, Observer, RunError, RunReport, StageReport};
use crate::link::shared::{
    LinkError, LinkReceiver, LinkSender, RunNames, SenderEnd, SharedOutputs, Wake, WakeEvents, Waker,
};
use crate::link::{InputQueue, latest, lower_bound};
use crate::pipeline::Pipeline;
use iceoryx2::node::Node;
use iceoryx2::service::Service;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

/// How often the run asks its observer whether it should stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// What a stage's thread tells the run.
enum Event {
    /// A source has done a share of its work.
    Progress { stage: usize, share: f64, log_time: crate::message::LogTime },
    /// The stage is done, or has failed.
    Ended { stage: usize, result: Result<StageReport, Failure> },
}

pub(super) fn run<S: Service + 'static>(pipeline: &Pipeline, observer: &dyn Observer) -> Result<RunReport, RunError> {
    let names = RunNames::unique();
    let plan = Plan::new(pipeline);
    let stop_reason = OnceLock::new();
    let failed = |failure: Failure| RunError { stage: pipeline.name.clone(), failure };
    let node = names.node::<S>().map_err(|error| failed(error.into()))?;
    // Made before the stages, so that a stage that fails at once finds the others stoppable.
    let wakers: Vec<Waker<S>> = (0..pipeline.stages.len())
        .map(|stage| plan.waker(&node, &names, pipeline, stage))
        .collect::<Result<_, LinkError>>()
        .map_err(|error| failed(error.into()))?;
    let (sender, receiver) = channel();
    let result = thread::scope(|scope| {
        for stage in 0..pipeline.stages.len() {
            let (sender, names, plan, stop_reason) = (sender.clone(), &names, &plan, &stop_reason);
            scope.spawn(move || match StageThread::<S>::connect(pipeline, plan, names, stage, &sender) {
                Ok(thread) => thread.run(stop_reason),
                Err(failure) => tell(&sender, Event::Ended { stage, result: Err(failure) }),
            });
        }
        drop(sender);
        supervise(pipeline, &wakers, &receiver, &stop_reason, observer)
    });
    drop((wakers, node));
    names.remove_rest();
    result
}

/// Waits for all stages. When one fails, stops the others.
fn supervise<S: Service>(
    pipeline: &Pipeline,
    wakers: &[Waker<S>],
    events: &Receiver<Event>,
    stop_reason: &OnceLock<String>,
    observer: &dyn Observer,
) -> Result<RunReport, RunError> {
    let name = |stage: usize| pipeline.stages[stage].name.clone();
    let mut reports: Vec<StageReport> = vec![StageReport::default(); pipeline.stages.len()];
    let mut first_error: Option<RunError> = None;
    let stop = |first_error: &mut Option<RunError>, error: RunError| {
        let error = first_error.get_or_insert(error);
        stop_reason.get_or_init(|| error.to_string());
        // A stage that has ended cannot be woken and need not be.
        wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::STOP)));
    };
    loop {
        // Asked with every event: a source that makes good progress leaves no time without any.
        if first_error.is_none() && observer.should_stop() {
            stop(&mut first_error, RunError { stage: pipeline.name.clone(), failure: Failure::Interrupted });
        }
        match events.recv_timeout(STOP_INTERVAL) {
            Ok(Event::Progress { stage, share, log_time }) => observer.progress(&name(stage), share, log_time),
            Ok(Event::Ended { stage, result: Ok(report) }) => reports[stage] = report,
            Ok(Event::Ended { result: Err(Failure::Link(LinkError::Stopped)), .. }) => {}
            Ok(Event::Ended { stage, result: Err(failure) }) => {
                stop(&mut first_error, RunError { stage: name(stage), failure });
            }
            Err(RecvTimeoutError::Timeout) => {
                if first_error.is_some() {
                    // A stage that was not listening yet when the stop was sent gets it again.
                    wakers.iter().for_each(|waker| drop(waker.wake(WakeEvents::STOP)));
                }
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    match first_error {
        Some(error) => Err(error),
        None => Ok(RunReport { stages: reports }),
    }
}

/// Tells the run something. It listens until all stages have ended.
fn tell(events: &Sender<Event>, event: Event) {
    let _ = events.send(event);
}

/// Who reads what, and how many peers each stage has: what both ends of a link must agree on.
struct Plan {
    readers: BTreeMap<(usize, usize), Vec<(usize, usize)>>,
    /// For each stage, the number of its readers over all ports.
    stage_readers: Vec<usize>,
    /// For each stage, how many may wake it: its readers, those it reads, and the run.
    peers: Vec<usize>,
}

impl Plan {
    fn new(pipeline: &Pipeline) -> Self {
        let readers = readers(pipeline);
        let mut stage_readers = vec![0; pipeline.stages.len()];
        for (&(stage, _), list) in &readers {
            stage_readers[stage] += list.len();
        }
        let peers = pipeline.stages.iter().zip(&stage_readers).map(|(spec, readers)| spec.inputs.len() + readers + 1);
        Self { peers: peers.collect(), readers, stage_readers }
    }

    fn waker<S: Service>(
        &self,
        node: &Node<S>,
        names: &RunNames,
        pipeline: &Pipeline,
        stage: usize,
    ) -> Result<Waker<S>, LinkError> {
        Waker::new(node, names, &pipeline.stages[stage].name, self.stage_readers[stage], self.peers[stage])
    }

    fn readers(&self, stage: usize, port: usize) -> &[(usize, usize)] {
        self.readers.get(&(stage, port)).map_or(&[], Vec::as_slice)
    }

    /// The number of one reader among all readers of a stage: counted port by port.
    fn reader_number(&self, stage: usize, port: usize, reader: (usize, usize)) -> usize {
        let before: usize = (0..port).map(|port| self.readers(stage, port).len()).sum();
        before + self.readers(stage, port).iter().position(|other| *other == reader).unwrap_or_default()
    }

    fn port_depth(&self, pipeline: &Pipeline, stage: usize, port: usize) -> usize {
        let depths = self.readers(stage, port).iter().map(|(reader, _)| pipeline.stages[*reader].depth);
        depths.max().unwrap_or(1)
    }
}

/// One stage in its thread.
struct StageThread<'a, S: Service> {
    runner: Runner,
    queues: Vec<InputQueue>,
    receivers: Vec<LinkReceiver<S>>,
    outputs: Rc<RefCell<SharedOutputs<S>>>,
    wake: Rc<Wake<S>>,
    stage: usize,
    /// After so many samples, the readers are told how far the stage is.
    flush_interval: usize,
    events: &'a Sender<Event>,
}

impl<'a, S: Service + 'static> StageThread<'a, S> {
    /// Runs the stage to its end and tells the run how it went.
    fn run(mut self, stop_reason: &OnceLock<String>) {
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
        let report = self.runner.into_report(waited)?;
        drop(self.queues);
        self.receivers.iter().try_for_each(LinkReceiver::acknowledge)?;
        Ok(report)
    }

    /// Makes the ends of all links of the stage, and the stage.
    fn connect(
        pipeline: &Pipeline,
        plan: &Plan,
        names: &RunNames,
        stage: usize,
        events: &'a Sender<Event>,
    ) -> Result<Self, Failure> {
        let spec = &pipeline.stages[stage];
        let node = names.node::<S>()?;
        let wake = Wake::new(&node, names, &spec.name, plan.stage_readers[stage], plan.peers[stage])?;
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
        let sent = Runner::outputs(pipeline, stage, |port| {
            places.get(port).copied().flatten().map(|link| SharedOutputs::sink(&outputs, link))
        });
        let runner = Runner::new(pipeline, stage, sent)?;
        let queues = spec.inputs.iter().map(|_| InputQueue::default()).collect();
        let flush_interval = (spec.depth / 2).max(1);
        Ok(Self { runner, queues, receivers, outputs, wake, stage, flush_interval, events })
    }

    fn drive_source(&mut self) -> Result<(), Failure> {
        /// After so many messages a source tells how far it is.
        const REPORT_INTERVAL: usize = 256;
        let mut count = 0;
        while self.runner.advance()? {
            count += 1;
            if count % REPORT_INTERVAL == 0 {
                self.wake.poll()?;
                let reached = self.outputs.borrow().reached();
                self.outputs.borrow_mut().flush(reached)?;
                if let Some(share) = self.runner.progress() {
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
            self.wake.take_data()?;
            self.receive()?;
            let mut handled = 0;
            while let Some(wire) = self.runner.handle_next(&mut self.queues)? {
                if !self.receivers[wire].taken()? {
                    continue;
                }
                handled += 1;
                if handled % self.flush_interval == 0 {
                    self.receive()?;
                    self.flush()?;
                }
            }
            if self.queues.iter().all(InputQueue::is_done) {
                let time = latest(&self.queues);
                self.runner.finish(time)?;
                return Ok(self.outputs.borrow_mut().end(time)?);
            }
            self.flush()?;
            for (receiver, queue) in self.receivers.iter_mut().zip(&self.queues) {
                receiver.relieve(queue)?;
            }
            self.wake.sleep_for_input()?;
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

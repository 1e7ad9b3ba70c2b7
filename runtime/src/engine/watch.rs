//! Observing a run that is in progress.

use super::links::Links;
use super::run_folder::{RunningRun, open_counters};
use super::statistics::run_statistics;
use super::{Failure, RunError};
use crate::link::{Observer, RunNames, SampleHeader, SharedCounters, StageCounters};
use crate::message::{Message, MessageFlags};
use crate::pipeline::{Mode, Pipeline};
use crate::stage::RunStatistics;
use iceoryx2::node::Node;
use iceoryx2::service::ipc::Service;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// The time to wait for a stage of a run to create its links.
const LINK_TIMEOUT: Duration = Duration::from_secs(10);
/// The interval at which a missing link is looked for.
const RETRY_INTERVAL: Duration = Duration::from_millis(10);

/// A link of a run that is observed by a program outside of the run. The observer never affects the run: if it is too
/// slow, it misses messages.
pub struct WatchedLink {
    observer: Observer<Service>,
    /// The sequence number of the next message of each sender.
    next: BTreeMap<u64, u64>,
    /// The number of messages missing in the sequences of their senders.
    missed: u64,
    /// The number of received messages, without duplicates.
    taken: u64,
    /// The counters of the stage that owns the link.
    counters: StageCounters,
    /// The index of the output port of that stage.
    port: usize,
    /// The messages and senders that had been counted when the observation began.
    sent_before: u64,
    senders_before: u64,
    _node: Node<Service>,
}

impl WatchedLink {
    /// Observes an output port of a stage of a run of the given pipeline. A live link repeats the last message of each
    /// topic for it.
    ///
    /// # Errors
    /// The port has no readers, the run has ended or does not create the link, or the link has the maximum number of
    /// observers.
    pub fn open(run: &RunningRun, pipeline: &Pipeline, stage: usize, port: usize) -> Result<Self, RunError> {
        let opening = Opening::new(run, pipeline, stage, port)?;
        let start = Instant::now();
        loop {
            match opening.observer()? {
                Some(observer) => return Ok(opening.begin(observer)),
                None if start.elapsed() < LINK_TIMEOUT && run.is_running() => thread::sleep(RETRY_INTERVAL),
                None => {
                    let (name, seconds) = (opening.output(), LINK_TIMEOUT.as_secs());
                    return Err(opening
                        .failed(Failure::Outside(format!("has not created its output `{name}` within {seconds} s"))));
                }
            }
        }
    }

    /// The same without waiting: none if the stage has not created the link yet.
    ///
    /// # Errors
    /// Those of [`open`](Self::open).
    pub fn open_now(
        run: &RunningRun,
        pipeline: &Pipeline,
        stage: usize,
        port: usize,
    ) -> Result<Option<Self>, RunError> {
        let opening = Opening::new(run, pipeline, stage, port)?;
        Ok(opening.observer()?.map(|observer| opening.begin(observer)))
    }

    /// Takes the messages since the last call, without duplicates, each with the header of its sample.
    pub fn take(&mut self, mut take: impl FnMut(&SampleHeader, Message)) -> Result<(), RunError> {
        let (next, missed, taken) = (&mut self.next, &mut self.missed, &mut self.taken);
        let taken = self.observer.take(|sample, message| {
            let sequence = message.header().sequence;
            let is_repeated = message.header().flags.contains(MessageFlags::REPEATED);
            // A repeated message says nothing about the position of the stream.
            if !is_repeated {
                let next = next.entry(sample.origin).or_insert(sequence);
                *missed += sequence.saturating_sub(*next);
                *next = sequence.saturating_add(1);
            }
            *taken += u64::from(message.header().flags.contains(MessageFlags::DATA));
            take(sample, message);
        });
        taken.map_err(RunError::of_run)
    }

    /// The number of messages that were missed.
    pub fn missed(&self) -> u64 {
        if self.counters.senders(self.port) == self.senders_before {
            return self.missed;
        }
        // All messages of an external sender may have been missed, but the owner of the link has counted them.
        let passed = self.counters.sent(self.port).saturating_sub(self.sent_before);
        self.missed.max(passed.saturating_sub(self.taken))
    }
}

/// A link to observe, which may not exist yet.
struct Opening<'a> {
    pipeline: &'a Pipeline,
    stage: usize,
    port: usize,
    names: RunNames,
    counters: Arc<SharedCounters>,
    node: Node<Service>,
}

impl<'a> Opening<'a> {
    fn new(run: &RunningRun, pipeline: &'a Pipeline, stage: usize, port: usize) -> Result<Self, RunError> {
        let spec = &pipeline.stages[stage];
        let of_stage = |failure: Failure| RunError::of_stage(&spec.name, failure);
        let counters = open_counters(&run.prefix, pipeline).map_err(|error| of_stage(error.into()))?;
        let names = run.names();
        let links = Links::new(pipeline, &names, &counters);
        if !links.is_read(stage, port) {
            let name = spec.kind.outputs[port].name;
            let text = format!("has no link for its output `{name}`, as nothing reads it");
            return Err(of_stage(Failure::Outside(text)));
        }
        let node = links.node::<Service>().map_err(|error| of_stage(error.into()))?;
        Ok(Self { pipeline, stage, port, names, counters, node })
    }

    fn output(&self) -> &'static str {
        self.pipeline.stages[self.stage].kind.outputs[self.port].name
    }

    fn failed(&self, failure: Failure) -> RunError {
        RunError::of_stage(&self.pipeline.stages[self.stage].name, failure)
    }

    fn observer(&self) -> Result<Option<Observer<Service>>, RunError> {
        let stage = &self.pipeline.stages[self.stage].name;
        let observer = Observer::new(&self.node, &self.names, stage, self.output());
        observer.map_err(|error| self.failed(error.into()))
    }

    fn begin(self, observer: Observer<Service>) -> WatchedLink {
        let counters = self.counters.stage(self.stage);
        if self.pipeline.mode == Mode::Live {
            counters.request_history();
        }
        WatchedLink {
            observer,
            next: BTreeMap::new(),
            missed: 0,
            taken: 0,
            sent_before: counters.sent(self.port),
            senders_before: counters.senders(self.port),
            counters,
            port: self.port,
            _node: self.node,
        }
    }
}

/// The statistics of the stages of a run.
///
/// # Errors
/// The run has ended.
pub fn watch_statistics(run: &RunningRun, pipeline: &Pipeline) -> Result<RunStatistics, RunError> {
    let counters = open_counters(&run.prefix, pipeline).map_err(|error| RunError::of_run(Failure::from(error)))?;
    Ok(run_statistics(pipeline, &counters))
}

/// The counters of each stage of a run, in the order of the pipeline.
///
/// # Errors
/// The run has ended.
pub fn watch_stages(run: &RunningRun, pipeline: &Pipeline) -> Result<Vec<StageCounters>, RunError> {
    let counters = open_counters(&run.prefix, pipeline).map_err(|error| RunError::of_run(Failure::from(error)))?;
    Ok((0..pipeline.stages.len()).map(|stage| counters.stage(stage)).collect())
}

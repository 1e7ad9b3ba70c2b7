//! Looking on at a run that is going on.

use super::links::Links;
use super::run_folder::{RunningRun, open_counters};
use super::statistics::run_statistics;
use super::{Failure, RunError};
use crate::link::{SharedCounters, Observer, RunNames, SampleHeader, StageCounters};
use crate::message::{Message, MessageFlags};
use crate::pipeline::{Mode, Pipeline};
use crate::stage::RunStatistics;
use iceoryx2::node::Node;
use iceoryx2::service::ipc::Service;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// So long the stages of a run may take to make their links.
const LINK_TIMEOUT: Duration = Duration::from_secs(10);
/// So often it is looked for a link that is not there yet.
const LOOK_INTERVAL: Duration = Duration::from_millis(10);

/// A link of a run, as a program sees it that looks on. It changes nothing in the run: where it is too slow, it misses
/// messages.
pub struct WatchedLink {
    observer: Observer<Service>,
    /// For each sender the number of its next message.
    next: BTreeMap<u64, u64>,
    /// How many messages were missed between others of their senders.
    missed: u64,
    /// How many came, each counted once.
    taken: u64,
    /// The stage that owns the link, and which of its ports that is.
    counters: StageCounters,
    port: usize,
    /// What that had counted when this began to look on: messages, and programs that have sent.
    sent_before: u64,
    senders_before: u64,
    _node: Node<Service>,
}

impl WatchedLink {
    /// Looks on at an output port of a stage of a run of the given pipeline. A live link sends the last message of each
    /// topic again for it.
    ///
    /// # Errors
    /// Nothing in the run reads the port, the run has gone or does not make the link, or too many look on.
    pub fn open(run: &RunningRun, pipeline: &Pipeline, stage: usize, port: usize) -> Result<Self, RunError> {
        let opening = Opening::new(run, pipeline, stage, port)?;
        let start = Instant::now();
        loop {
            match opening.observer()? {
                Some(observer) => return Ok(opening.begin(observer)),
                None if start.elapsed() < LINK_TIMEOUT && run.is_running() => thread::sleep(LOOK_INTERVAL),
                None => {
                    let (name, seconds) = (opening.output(), LINK_TIMEOUT.as_secs());
                    return Err(opening
                        .failed(Failure::Outside(format!("has not made its output `{name}` within {seconds} s"))));
                }
            }
        }
    }

    /// The same without waiting: none if the stage has not made the link yet.
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

    /// Takes the messages that have passed since the last call: each once, with the header of its sample.
    pub fn take(&mut self, mut take: impl FnMut(&SampleHeader, Message)) -> Result<(), RunError> {
        let (next, missed, taken) = (&mut self.next, &mut self.missed, &mut self.taken);
        let taken = self.observer.take(|sample, message| {
            let sequence = message.header().sequence;
            let is_repeated = message.header().flags.contains(MessageFlags::REPEATED);
            // What is repeated does not tell where the stream stands.
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

    /// How many messages it was too slow for.
    pub fn missed(&self) -> u64 {
        if self.counters.senders(self.port) == self.senders_before {
            return self.missed;
        }
        // Of a program that came and went meanwhile nothing may have been seen, but the owner of the link has counted it.
        let passed = self.counters.sent(self.port).saturating_sub(self.sent_before);
        self.missed.max(passed.saturating_sub(self.taken))
    }
}

/// A link that may not be there yet.
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
            let text = format!("has an output `{name}` that nothing reads, and so it is no link");
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

/// Tells what the stages of a run have done so far.
pub fn watch_statistics(run: &RunningRun, pipeline: &Pipeline) -> Result<RunStatistics, RunError> {
    let counters = open_counters(&run.prefix, pipeline).map_err(|error| RunError::of_run(Failure::from(error)))?;
    Ok(run_statistics(pipeline, &counters))
}

/// What each stage of a run shows of itself, in the order of the pipeline.
pub fn watch_stages(run: &RunningRun, pipeline: &Pipeline) -> Result<Vec<StageCounters>, RunError> {
    let counters = open_counters(&run.prefix, pipeline).map_err(|error| RunError::of_run(Failure::from(error)))?;
    Ok((0..pipeline.stages.len()).map(|stage| counters.stage(stage)).collect())
}

//! The engine `single`: all stages in one thread.
//!
//! In each round the source with the earliest log time sends a few messages; then each stage, in the order of the
//! pipeline, handles all messages that it can and raises its watermark. Queues stay short, and no stage is ever stuck,
//! as each sees the watermarks of all stages before it in the same round.

use super::runner::{Runner, readers};
use super::{Failure, Observer, RunError, RunReport};
use crate::link::direct::{DirectLink, SharedQueue};
use crate::link::{InputQueue, latest, lower_bound};
use crate::message::LogTime;
use crate::pipeline::Pipeline;
use crate::stage::OutputSink;
use std::rc::Rc;

/// The number of times that a source advances per round.
const ADVANCES_PER_ROUND: usize = 64;

/// The memory of what a source has sent to a stage after which its round ends, bytes.
const BYTES_PER_ROUND: usize = 64 << 20;

struct SingleStage {
    runner: Runner,
    /// The messages received since the last round, by wire.
    inbox: Vec<SharedQueue>,
    queues: Vec<InputQueue>,
    links: Vec<DirectLink>,
    done: bool,
}

pub(super) fn run(pipeline: &Pipeline, observer: &dyn Observer) -> Result<RunReport, RunError> {
    let mut stages = connect(pipeline)?;
    let result = drive(pipeline, &mut stages, observer);
    if let Err(error) = result {
        let reason = error.to_string();
        stages.iter_mut().for_each(|stage| stage.runner.abort(&reason));
        return Err(error);
    }
    let mut report = RunReport::default();
    for (stage, spec) in stages.into_iter().zip(&pipeline.stages) {
        let stage = stage.runner.into_report(Default::default());
        report.stages.push(stage.map_err(|failure| RunError::of_stage(&spec.name, failure))?);
    }
    Ok(report)
}

/// Creates the stages and connects their queues to their links.
fn connect(pipeline: &Pipeline) -> Result<Vec<SingleStage>, RunError> {
    let inboxes: Vec<Vec<SharedQueue>> =
        pipeline.stages.iter().map(|spec| spec.inputs.iter().map(|_| SharedQueue::default()).collect()).collect();
    let readers = readers(pipeline);
    let mut stages = Vec::with_capacity(inboxes.len());
    for (index, spec) in pipeline.stages.iter().enumerate() {
        // Clones of a link share its state.
        let mut links: Vec<DirectLink> = spec.kind.outputs.iter().map(|_| DirectLink::default()).collect();
        for (port, link) in links.iter_mut().enumerate() {
            for &(reader, wire) in readers.get(&(index, port)).into_iter().flatten() {
                link.add_reader(Rc::clone(&inboxes[reader][wire]), wire);
            }
        }
        let sink = |port: usize| {
            let link = links.get(port).filter(|link| link.has_readers())?;
            Some(Box::new(link.clone()) as Box<dyn OutputSink>)
        };
        let runner = Runner::new(pipeline, index, &pipeline.context(index), sink);
        let runner = runner.map_err(|failure| RunError::of_stage(&spec.name, failure))?;
        let own = spec.inputs.iter().map(|_| InputQueue::default()).collect();
        stages.push(SingleStage { runner, inbox: inboxes[index].clone(), queues: own, links, done: false });
    }
    Ok(stages)
}

fn drive(pipeline: &Pipeline, stages: &mut [SingleStage], observer: &dyn Observer) -> Result<(), RunError> {
    let failed = |stage: usize| move |failure: Failure| RunError::of_stage(&pipeline.stages[stage].name, failure);
    while let Some(source) = furthest_behind(stages) {
        stages[source].advance_source().map_err(failed(source))?;
        if let Some(share) = stages[source].runner.progress().map_err(failed(source))? {
            observer.progress(&pipeline.stages[source].name, share, stages[source].reached());
        }
        for (index, stage) in stages.iter_mut().enumerate() {
            // A source or the stage before may have worked for long.
            if !observer.should_stop() {
                stage.handle_all(observer).map_err(failed(index))?;
            }
        }
        if observer.should_stop() {
            return Err(RunError::of_run(Failure::Interrupted));
        }
    }
    Ok(())
}

/// The source with the earliest log time among those that are not done.
fn furthest_behind(stages: &[SingleStage]) -> Option<usize> {
    let sources = stages.iter().enumerate().filter(|(_, stage)| stage.runner.is_source() && !stage.done);
    sources.min_by_key(|(index, stage)| (stage.reached(), *index)).map(|(index, _)| index)
}

impl SingleStage {
    fn reached(&self) -> LogTime {
        self.links.iter().map(DirectLink::reached).max().unwrap_or_default()
    }

    fn advance_source(&mut self) -> Result<(), Failure> {
        for _ in 0..ADVANCES_PER_ROUND {
            if !self.runner.advance()? {
                self.end(self.reached());
                return Ok(());
            }
            if self.links.iter().any(|link| link.pending_bytes() >= BYTES_PER_ROUND) {
                break;
            }
        }
        let watermark = self.reached();
        self.links.iter().for_each(|link| link.raise(watermark));
        Ok(())
    }

    /// Handles all pending messages, unless the run is to stop.
    fn handle_all(&mut self, observer: &dyn Observer) -> Result<(), Failure> {
        if self.done || self.runner.is_source() {
            return Ok(());
        }
        for (queue, inbox) in self.queues.iter_mut().zip(&self.inbox) {
            queue.append(&mut inbox.borrow_mut());
        }
        while self.runner.handle_next(&mut self.queues)?.is_some() {
            if observer.should_stop() {
                return Ok(());
            }
        }
        self.runner.check_pending(&self.queues)?;
        match lower_bound(&self.queues) {
            Some(watermark) => self.links.iter().for_each(|link| link.raise(watermark)),
            None => {
                let time = latest(&self.queues);
                self.runner.finish(time)?;
                self.end(time);
            }
        }
        Ok(())
    }

    fn end(&mut self, time: LogTime) {
        self.done = true;
        self.links.iter().for_each(|link| link.end(time));
    }
}

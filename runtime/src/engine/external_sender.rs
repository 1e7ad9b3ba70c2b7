//! Sending messages to a live run from outside.

use super::links::Links;
use super::run_folder::{RunningRun, open_counters};
use super::{Failure, RunError};
use crate::link::SharedCounters;
use crate::link::{Control, LinkError, LinkSender, Outputs, SenderRole, Sleeper};
use crate::pipeline::{Mode, Pipeline};
use crate::stage::OutputSink;
use iceoryx2::node::Node;
use iceoryx2::service::ipc::Service;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A program outside of a live run that sends on the outputs of an external source of the run.
pub struct ExternalSender {
    ports: Vec<usize>,
    outputs: Rc<RefCell<Outputs<Service>>>,
    sleeper: Rc<Sleeper>,
    stopper: SenderStopper,
    run: RunningRun,
    _node: Node<Service>,
}

/// Stops a [`ExternalSender`] from another thread.
#[derive(Clone)]
pub struct SenderStopper {
    control: Arc<Control>,
    counters: Arc<SharedCounters>,
}

impl SenderStopper {
    /// Makes every wait for credit fail, pending and future.
    pub fn stop(&self) {
        self.control.stop(&self.counters);
    }
}

impl ExternalSender {
    /// Joins a run of the given pipeline as a sender on the outputs of the stage with the given index.
    ///
    /// # Errors
    /// The stage is no external source, the run has ended, or the link has the maximum number of senders.
    pub fn join(run: &RunningRun, pipeline: &Pipeline, stage: usize) -> Result<Self, RunError> {
        let spec = &pipeline.stages[stage];
        if pipeline.mode != Mode::Live || !spec.kind.is_external() {
            let text = format!("takes no messages from outside, as it is a `{}`", spec.kind.name);
            return Err(RunError::of_stage(&spec.name, Failure::Outside(text)));
        }
        let of_stage = |failure: Failure| RunError::of_stage(&spec.name, failure);
        let counters = open_counters(&run.prefix, pipeline).map_err(|error| of_stage(error.into()))?;
        let (names, control) = (run.names(), Arc::new(Control::default()));
        let links = Links::new(pipeline, &names, &counters);
        let node = links.node::<Service>().map_err(|error| of_stage(error.into()))?;
        let senders = links.senders(&node, stage, SenderRole::External).map_err(|error| of_stage(error.into()))?;
        let (ports, senders) = senders.into_iter().unzip();
        let sleeper = Rc::new(Sleeper::new(counters.stage(stage), Arc::clone(&control)));
        let outputs = Outputs::new(senders, Rc::clone(&sleeper));
        let stopper = SenderStopper { control, counters };
        Ok(Self { ports, outputs, sleeper, stopper, run: run.clone(), _node: node })
    }

    /// A handle that stops it from another thread.
    pub fn stopper(&self) -> SenderStopper {
        self.stopper.clone()
    }

    /// The output port with the given index; none if nothing reads it.
    pub fn output(&self, port: usize) -> Option<Box<dyn OutputSink>> {
        Some(Outputs::sink(&self.outputs, self.ports.binary_search(&port).ok()?))
    }

    /// Waits until every reader and the stage itself, which retains the history for late joiners, are connected, so
    /// that none misses the first messages. Returns `false` after the timeout.
    pub fn wait_for_readers(&self, longest: Duration) -> bool {
        self.wait(&self.sleeper, longest, |sender| sender.is_connected())
    }

    /// Waits until every reader and the stage itself have taken all messages; those that were not taken are lost with
    /// their sender. Returns `false` after the timeout. A stopped sender waits too: it sends no more, but its readers
    /// continue.
    pub fn wait_until_taken(&self, longest: Duration) -> bool {
        let sleeper = Sleeper::new(self.sleeper.counters().clone(), Arc::default());
        self.wait(&sleeper, longest, LinkSender::is_taken)
    }

    /// Waits until all links are ready, and the stage has ingested what was sent so far.
    fn wait(&self, sleeper: &Sleeper, longest: Duration, is_ready: impl Fn(&mut LinkSender<Service>) -> bool) -> bool {
        // The stage sees the messages of this sender only while it exists: without waiting for the stage, those of a
        // short-lived sender would be missed.
        let (counters, asked) = (sleeper.counters(), sleeper.counters().request_ingest());
        let are_ready = || {
            if !self.run.is_running() {
                return Err(LinkError::Stopped);
            }
            Ok(counters.has_ingested(asked) && self.outputs.borrow_mut().links().iter_mut().all(&is_ready))
        };
        sleeper.wait_until(Some(Instant::now() + longest), are_ready).unwrap_or(false)
    }
}

//! Sending into a live run from outside of it.

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

/// A program that sends on the outputs of a stage of a live run whose messages come from outside.
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
    /// A sender of the feed that waits for room gives up, and so does one that is to wait later.
    pub fn stop(&self) {
        self.control.stop(&self.counters);
    }
}

impl ExternalSender {
    /// Joins a run of the given pipeline as a sender on the outputs of the stage with the given index.
    ///
    /// # Errors
    /// The stage makes its messages itself, the run has gone, or too many send already.
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

    /// What stops it from another thread.
    pub fn stopper(&self) -> SenderStopper {
        self.stopper.clone()
    }

    /// The output port with the given index; none if nothing reads it.
    pub fn output(&self, port: usize) -> Option<Box<dyn OutputSink>> {
        Some(Outputs::sink(&self.outputs, self.ports.binary_search(&port).ok()?))
    }

    /// Waits until every reader and the stage itself, which repeats the last messages to who comes late, are connected, so
    /// that none misses the first messages. `false` if it takes too long.
    pub fn wait_for_readers(&self, longest: Duration) -> bool {
        self.wait(&self.sleeper, longest, |sender| sender.is_connected())
    }

    /// Waits until every reader and the stage itself have taken all that was sent. What is sent is lost with its sender where it
    /// has not been taken. `false` if it takes too long. A feed that was stopped waits as well: it sends no more, but its readers
    /// go on.
    pub fn wait_until_taken(&self, longest: Duration) -> bool {
        let sleeper = Sleeper::new(self.sleeper.counters().clone(), Arc::default());
        self.wait(&sleeper, longest, LinkSender::is_taken)
    }

    /// Waits until all links are ready, and the stage has taken in what was sent so far.
    fn wait(&self, sleeper: &Sleeper, longest: Duration, is_ready: impl Fn(&mut LinkSender<Service>) -> bool) -> bool {
        // The stage sees a program that sends only while that is there: without its answer a short visit would pass unseen.
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

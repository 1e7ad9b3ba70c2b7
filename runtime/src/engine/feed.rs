//! Sending into a live run from outside of it.

use super::live_links::{LiveLinks, SharedSender};
use super::plan::Plan;
use super::run_folder::{RunningRun, open_board};
use super::{Failure, RunError};
use crate::link::board::StageBoard;
use crate::link::live::{LiveSender, Pause};
use crate::pipeline::{Mode, Pipeline};
use crate::stage::OutputSink;
use iceoryx2::node::Node;
use iceoryx2::service::ipc::Service;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// So often a feed looks whether its readers are ready.
const LOOK_INTERVAL: Duration = Duration::from_millis(2);

/// A program that sends on the outputs of a stage of a live run whose messages come from outside.
pub struct Feed {
    senders: Vec<Option<SharedSender<Service>>>,
    run: RunningRun,
    stop: Arc<AtomicBool>,
    _node: Node<Service>,
}

impl Feed {
    /// Joins a run of the given pipeline as a sender on the outputs of the stage with the given index. A sender that waits
    /// for room gives up when `stop` is set.
    ///
    /// # Errors
    /// The stage makes its messages itself, the run has gone, or too many send already.
    pub fn join(run: &RunningRun, pipeline: &Pipeline, stage: usize, stop: Arc<AtomicBool>) -> Result<Self, RunError> {
        let spec = &pipeline.stages[stage];
        if pipeline.mode != Mode::Live || !spec.kind.is_external() {
            let text = format!("takes no messages from outside, as it is a `{}`", spec.kind.name);
            return Err(RunError::of_stage(&spec.name, Failure::Outside(text)));
        }
        let of_stage = |failure: Failure| RunError::of_stage(&spec.name, failure);
        let board = open_board(&run.prefix, pipeline).map_err(|error| of_stage(error.into()))?;
        let boards: Vec<StageBoard> = (0..pipeline.stages.len()).map(|stage| board.stage(stage)).collect();
        let (names, plan) = (run.names(), Plan::new(pipeline));
        let node = names.node::<Service>().map_err(|error| of_stage(error.into()))?;
        let links = LiveLinks { pipeline, plan: &plan, names: &names, boards: &boards };
        let senders = links.senders(&node, stage, &Pause::Program(Arc::clone(&stop)), false);
        Ok(Self { senders: senders.map_err(|error| of_stage(error.into()))?, run: run.clone(), stop, _node: node })
    }

    /// The output port with the given index; none if nothing reads it.
    pub fn output(&self, port: usize) -> Option<Box<dyn OutputSink>> {
        Some(self.senders.get(port)?.as_ref()?.sink())
    }

    /// Waits until every reader is connected, so that none misses the first messages. `false` if it takes too long.
    pub fn wait_for_readers(&self, longest: Duration) -> bool {
        self.wait(longest, |sender| sender.is_connected())
    }

    /// Waits until every reader has taken all that was sent. What is sent is lost with its sender where it has not been
    /// taken. `false` if it takes too long.
    pub fn wait_until_taken(&self, longest: Duration) -> bool {
        self.wait(longest, LiveSender::is_taken)
    }

    fn wait(&self, longest: Duration, is_ready: impl Fn(&mut LiveSender<Service>) -> bool) -> bool {
        let start = Instant::now();
        while !self.senders.iter().flatten().all(|sender| is_ready(&mut sender.get())) {
            if start.elapsed() > longest || self.stop.load(Ordering::Relaxed) || !self.run.is_running() {
                return false;
            }
            thread::sleep(LOOK_INTERVAL);
        }
        true
    }
}

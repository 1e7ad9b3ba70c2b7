//! A process of a run, as the supervisor knows it.

use super::backoff::Backoff;
use super::system::memory_of_process;
use super::protocol::{Told, say};
use crate::engine::Failure;
use crate::pipeline::Pipeline;
use std::process::{Child, ChildStdin};
use std::time::{Duration, Instant};

/// A process, as the supervisor knows it.
pub(super) struct Process {
    pub(super) name: String,
    pub(super) child: Child,
    pub(super) stdin: Option<ChildStdin>,
    /// The indexes of its stages.
    pub(super) stages: Vec<usize>,
    /// The stages that have not ended.
    pub(super) running: Vec<String>,
    pub(super) heard: Instant,
    pub(super) ended: bool,
    /// Whether it is started again when it fails.
    pub(super) restarts: bool,
    pub(super) backoff: Backoff,
    /// Why it has failed, if it was able to say so.
    pub(super) failure: Option<(String, Failure)>,
    /// When it is to be started again.
    pub(super) start_at: Option<Instant>,
}

impl Process {
    /// Whether anything is to be expected of it.
    pub(super) fn is_over(&self) -> bool {
        self.ended && self.start_at.is_none()
    }

    /// Tells it something. One that cannot be told has died, which is heard in another way.
    pub(super) fn tell(&mut self, words: &Told) {
        let _ = self.stdin.as_mut().map(|stdin| say(stdin, words));
    }

    /// Why it must be killed, if it must: it has not said for too long that it is alive, of which the supervisor itself was
    /// awake for `awake_for`, or it has taken more memory than it may.
    pub(super) fn trouble(&self, pipeline: &Pipeline, awake_for: Duration) -> Option<Failure> {
        if let Some(longest) = pipeline.stall_timeout.filter(|longest| self.heard.elapsed().min(awake_for) > *longest) {
            return Some(Failure::Hung { seconds: longest.as_secs_f64() });
        }
        let limit = pipeline.memory_limit?;
        let taken = memory_of_process(self.child.id()).filter(|taken| *taken > limit)?;
        Some(Failure::Memory { taken, limit })
    }
}

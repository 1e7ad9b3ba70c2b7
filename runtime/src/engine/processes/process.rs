//! The supervisor's state for a process of a run.

use super::backoff::Backoff;
use super::protocol::{SupervisorCommand, write_line};
use super::system::memory_of_process;
use crate::engine::Failure;
use crate::pipeline::Pipeline;
use std::process::{Child, ChildStdin};
use std::time::{Duration, Instant};

/// The supervisor's state for a process.
pub(super) struct Process {
    pub(super) name: String,
    pub(super) child: Child,
    pub(super) stdin: Option<ChildStdin>,
    /// The indexes of its stages.
    pub(super) stages: Vec<usize>,
    /// The stages that have not ended.
    pub(super) running: Vec<String>,
    pub(super) last_report: Instant,
    pub(super) ended: bool,
    /// Whether it is restarted when it fails.
    pub(super) restarts: bool,
    pub(super) backoff: Backoff,
    /// The stage that failed and the cause, if the process was able to report it.
    pub(super) failure: Option<(String, Failure)>,
    /// When it will be restarted.
    pub(super) start_at: Option<Instant>,
}

impl Process {
    /// Whether it has ended and will not be restarted.
    pub(super) fn is_over(&self) -> bool {
        self.ended && self.start_at.is_none()
    }

    /// Sends it a command. A failure is ignored: the process has died, which is noticed by its closed output.
    pub(super) fn send(&mut self, command: &SupervisorCommand) {
        let _ = self.stdin.as_mut().map(|stdin| write_line(stdin, command));
    }

    /// Why it must be killed, if it must: it has sent no report for too long, during which the supervisor was not
    /// suspended (`awake_for`), or it exceeds its memory limit.
    pub(super) fn check(&self, pipeline: &Pipeline, awake_for: Duration) -> Option<Failure> {
        if let Some(longest) =
            pipeline.stall_timeout.filter(|longest| self.last_report.elapsed().min(awake_for) > *longest)
        {
            return Some(Failure::Hung { seconds: longest.as_secs_f64() });
        }
        let limit = pipeline.memory_limit?;
        let taken = memory_of_process(self.child.id()).filter(|taken| *taken > limit)?;
        Some(Failure::Memory { taken, limit })
    }
}

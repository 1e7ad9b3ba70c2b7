//! How a stage sleeps, and how it is stopped or drained.

use super::LinkError;
use super::counters::{SharedCounters, monotonic_nanoseconds};
use super::protocol;
use super::stage_counters::{StageCounter, StageCounters};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest sleep before a stage checks its links again. Correctness does not depend on it; it limits the delay if a
/// process is killed between changing a doorbell and waking those that sleep on it.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);

/// Requests to all stages of one process: to stop, or to drain.
#[derive(Debug, Default)]
pub struct Control {
    stopped: AtomicBool,
    draining: AtomicBool,
}

impl Control {
    /// Requests that all stages stop at once.
    pub fn stop(&self, counters: &SharedCounters) {
        self.stopped.store(true, Ordering::Release);
        counters.ring_all();
    }

    /// Requests that a live run ends: sources send no more, and pending messages are handled.
    pub fn drain(&self, counters: &SharedCounters) {
        self.draining.store(true, Ordering::Release);
        counters.ring_all();
    }

    /// Whether the end of a live run was requested.
    pub(crate) fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Acquire)
    }
}

/// The means of sleeping of a stage, or of a program that sends as that stage.
pub struct Sleeper {
    counters: StageCounters,
    control: Arc<Control>,
    /// The time slept for credit while handling messages.
    waited: Cell<Duration>,
}

impl Sleeper {
    /// A sleeper on the doorbell of a stage.
    pub fn new(counters: StageCounters, control: Arc<Control>) -> Self {
        Self { counters, control, waited: Cell::default() }
    }

    /// The counters of the stage.
    pub(crate) fn counters(&self) -> &StageCounters {
        &self.counters
    }

    /// The requests to the stages of the process.
    pub(crate) fn control(&self) -> &Control {
        &self.control
    }

    /// The time slept for credit while handling messages.
    pub(crate) fn waited(&self) -> Duration {
        self.waited.get()
    }

    /// Checks that the run goes on.
    ///
    /// # Errors
    /// The run is being stopped.
    pub(crate) fn check(&self) -> Result<(), LinkError> {
        match self.control.stopped.load(Ordering::Acquire) {
            true => Err(LinkError::Stopped),
            false => Ok(()),
        }
    }

    /// Sleeps until `is_ready`. Whoever changes a state that this depends on must ring the doorbell afterwards.
    pub(crate) fn wait(&self, is_ready: impl FnMut() -> Result<bool, LinkError>) -> Result<(), LinkError> {
        self.wait_until(None, is_ready).map(|_| ())
    }

    /// Sleeps until `is_ready` or until `end`. Returns whether it is ready.
    pub(crate) fn wait_until(
        &self,
        end: Option<Instant>,
        mut is_ready: impl FnMut() -> Result<bool, LinkError>,
    ) -> Result<bool, LinkError> {
        self.check()?;
        if is_ready()? {
            return Ok(true);
        }
        let working_since = self.counters.get(StageCounter::WorkingSince);
        let begin = Instant::now();
        if working_since != 0 {
            self.counters.set(StageCounter::WorkingSince, 0);
        }
        let result = self.sleep_until(end, &mut is_ready);
        if working_since != 0 {
            self.counters.set(StageCounter::WorkingSince, monotonic_nanoseconds());
            self.waited.set(self.waited.get() + begin.elapsed());
        }
        result
    }

    fn sleep_until(
        &self,
        end: Option<Instant>,
        is_ready: &mut dyn FnMut() -> Result<bool, LinkError>,
    ) -> Result<bool, LinkError> {
        let mut ready = false;
        loop {
            let longest = end.map_or(LONGEST_SLEEP, |end| end.saturating_duration_since(Instant::now()));
            protocol::sleep(self.counters.doorbell(), longest.min(LONGEST_SLEEP), || {
                self.check()?;
                ready = is_ready()?;
                Ok::<_, LinkError>(ready)
            })?;
            if ready || longest.is_zero() {
                return Ok(ready);
            }
        }
    }
}

//! What the stages of a run have done so far, for stages that show it.

use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// What one stage has done so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageStatistics {
    /// Its name in the pipeline.
    pub name: String,
    /// How it stands: `absent`, `starting`, `running` or `ended`.
    pub state: &'static str,
    /// Messages that it was given.
    pub messages_in: u64,
    /// Messages that it has sent.
    pub messages_out: u64,
    /// How long it has worked, milliseconds.
    pub busy_ms: f64,
    /// Messages that were dropped on their way to it because there was no room.
    pub dropped: u64,
    /// How often it was started again after a failure.
    pub restarts: u64,
    /// How often it has warned of something.
    pub warnings: u64,
}

/// Tells what the stages of a run have done so far. It changes with the clock: nothing that a stage makes of its input may rest
/// on it.
#[derive(Clone)]
pub struct RunStatistics(Arc<dyn Fn() -> Vec<StageStatistics> + Send + Sync>);

impl RunStatistics {
    /// Tells what `now` gives.
    pub fn new(now: impl Fn() -> Vec<StageStatistics> + Send + Sync + 'static) -> Self {
        Self(Arc::new(now))
    }

    /// All stages, in the order of the pipeline.
    pub fn now(&self) -> Vec<StageStatistics> {
        (self.0)()
    }
}

impl fmt::Debug for RunStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunStatistics").finish_non_exhaustive()
    }
}

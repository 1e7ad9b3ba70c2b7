//! The statistics of a run, for stages that show them.

use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// The statistics of one stage so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageStatistics {
    /// The name of the stage in the pipeline.
    pub name: String,
    /// Its state: `absent`, `starting`, `running` or `ended`.
    pub state: &'static str,
    /// Messages that it has received.
    pub messages_in: u64,
    /// Messages that it has sent.
    pub messages_out: u64,
    /// Its working time, milliseconds.
    pub busy_ms: f64,
    /// Messages to it that were dropped because it had not granted credit for them.
    pub dropped: u64,
    /// How often it was restarted after a failure.
    pub restarts: u64,
    /// The number of its warnings.
    pub warnings: u64,
}

/// The statistics of the stages of a run. They depend on timing: the outputs of a stage must not depend on them.
#[derive(Clone)]
pub struct RunStatistics(Arc<dyn Fn() -> Vec<StageStatistics> + Send + Sync>);

impl RunStatistics {
    /// Statistics that are read by `now`.
    pub fn new(now: impl Fn() -> Vec<StageStatistics> + Send + Sync + 'static) -> Self {
        Self(Arc::new(now))
    }

    /// The current statistics of all stages, in the order of the pipeline.
    pub fn now(&self) -> Vec<StageStatistics> {
        (self.0)()
    }
}

impl fmt::Debug for RunStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunStatistics").finish_non_exhaustive()
    }
}

//! The report of a run.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Duration;

/// The report of a run.
#[derive(Clone, Debug, Default)]
pub struct RunReport {
    /// The reports of the stages, in the order of the pipeline.
    pub stages: Vec<StageReport>,
}

/// The report of one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// The name of the stage in the pipeline.
    pub name: String,
    /// The kind of the stage.
    pub kind: String,
    /// Messages that it has received.
    pub messages_in: u64,
    /// Messages that it has sent.
    pub messages_out: u64,
    /// Messages that a live pipeline has dropped because the stage had not granted credit for them.
    pub dropped: u64,
    /// How often a live pipeline has restarted it after a failure. Warnings and counts are those since the last
    /// restart.
    pub restarts: u64,
    /// Its working time, without waiting for others.
    pub busy: Duration,
    /// Its warnings, each with the number of times.
    pub warnings: BTreeMap<String, u64>,
    /// Its counts of what it has done, such as searches.
    pub counts: BTreeMap<String, u64>,
}

impl RunReport {
    /// The warnings of all stages: stage, text, and number of times.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &str, u64)> {
        self.stages
            .iter()
            .flat_map(|stage| stage.warnings.iter().map(|(what, count)| (stage.name.as_str(), what.as_str(), *count)))
    }
}

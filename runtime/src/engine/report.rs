//! What a run has done.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Duration;

/// What a run has done, stage by stage in the order of the pipeline.
#[derive(Clone, Debug, Default)]
pub struct RunReport {
    /// The stages.
    pub stages: Vec<StageReport>,
}

/// What one stage has done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Its name in the pipeline.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// Messages it was given.
    pub messages_in: u64,
    /// Messages it has sent.
    pub messages_out: u64,
    /// Messages that a live pipeline has dropped because the stage had no room for them.
    pub dropped: u64,
    /// How often a live pipeline has started it again after a failure. What else stands here is since the last time.
    pub restarts: u64,
    /// How long it worked, without waiting for others.
    pub busy: Duration,
    /// What was wrong with its input and how often.
    pub warnings: BTreeMap<String, u64>,
    /// What it has counted of its work, such as searches.
    pub counts: BTreeMap<String, u64>,
}

impl RunReport {
    /// All warnings of all stages.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &str, u64)> {
        self.stages
            .iter()
            .flat_map(|stage| stage.warnings.iter().map(|(what, count)| (stage.name.as_str(), what.as_str(), *count)))
    }
}

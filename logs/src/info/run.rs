//! The run that wrote a log, as recorded in the log.

use crate::reader::LogFile;
use crate::reader::OUTCOME_RECORD;
use crate::sink::{INPUTS_RECORD, InputFile, RUN_RECORD};
use serde::Serialize;

/// The run that wrote a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RunInfo {
    /// The version of Gridweave.
    pub version: String,
    /// The pipeline with all its parameters and its seed, as the text of a pipeline file.
    pub pipeline: String,
    /// The input files; empty if the run did not complete.
    pub inputs: Vec<InputFile>,
}

impl RunInfo {
    /// Reads the record about the run; `None` if the log is not from Gridweave.
    pub(super) fn of(file: &LogFile) -> Option<Self> {
        let run = file.metadata(RUN_RECORD)?;
        let text = |key: &str| run.get(key).cloned().unwrap_or_default();
        let inputs = file.metadata(INPUTS_RECORD).into_iter().flat_map(|inputs| inputs.values());
        Some(Self {
            version: text("version"),
            pipeline: text("pipeline"),
            inputs: inputs.filter_map(|input| serde_json::from_str(input).ok()).collect(),
        })
    }
}

/// Whether a metadata record is about the run that wrote it.
pub(super) fn is_of_run(name: &str) -> bool {
    [RUN_RECORD, INPUTS_RECORD, OUTCOME_RECORD].contains(&name)
}

//! The stage `summary_sink`.

use super::{Areas, Bend, Summary};
use crate::file::replace;
use gridweave_runtime::ros::{MapAgreement, MapDeformation, RobotFrames, Verdicts};
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `summary_sink`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SummaryParameters {
    /// The JSON file to write. A file that has this name is replaced.
    file: PathBuf,
}

impl Parameters for SummaryParameters {}

/// The kind `summary_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "summary_sink",
        "Writes what a merge has found to a JSON file, at the end of the run.",
        SummarySink::new,
    )
    .inputs("frames", "where the robots' maps lie", SummarySink::frames)
    .optional_inputs("verdicts", "what became of each pair of robots", SummarySink::verdicts)
    .optional_inputs("agreement", "how far the maps agree that were fused", SummarySink::agreement)
    .optional_inputs("deformation", "how the maps are bent", SummarySink::deformation)
    .finish(SummarySink::write)
    .build()
}

/// Keeps the last of what it is told.
struct SummarySink {
    file: PathBuf,
    /// The stage at the other end of each wire.
    from: Vec<String>,
    summary: Summary,
}

impl SummarySink {
    fn new(SummaryParameters { file }: SummaryParameters, context: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = format!("write the summary of stage `{}`", context.stage);
            return Err(StageError::new(doing, "it has no file").with_help("give --summary FILE or file = \"FILE\""));
        }
        let from = context.inputs.iter().map(|wire| wire.from.clone()).collect();
        Ok(Self { file, from, summary: Summary::default() })
    }

    fn frames(&mut self, frames: Received<'_, RobotFrames>, _: &Output<()>) -> Result<(), StageError> {
        self.summary.set_frames(&frames);
        Ok(())
    }

    fn verdicts(&mut self, verdicts: Received<'_, Verdicts>, _: &Output<()>) -> Result<(), StageError> {
        self.summary.set_verdicts(&verdicts);
        Ok(())
    }

    fn agreement(&mut self, agreement: Received<'_, MapAgreement>, _: &Output<()>) -> Result<(), StageError> {
        let stage = self.from.get(agreement.wire()).cloned().unwrap_or_default();
        self.summary.areas.insert(stage, Areas::from(&*agreement));
        Ok(())
    }

    fn deformation(&mut self, deformation: Received<'_, MapDeformation>, _: &Output<()>) -> Result<(), StageError> {
        // Of a map that knows nothing there is nothing to say.
        if !deformation.nodes.is_empty() {
            self.summary.bends.insert(deformation.robot.clone(), Bend::from(&*deformation));
        }
        Ok(())
    }

    fn write(&mut self, _: &Output<()>) -> Result<(), StageError> {
        let failed = |cause: &dyn std::fmt::Display| {
            StageError::new(format!("write the summary {}", self.file.display()), cause)
        };
        let text = serde_json::to_string_pretty(&self.summary).map_err(|error| failed(&error))? + "\n";
        replace(&[(&self.file, text.as_bytes())]).map_err(|error| failed(&error))
    }
}

//! The stage `summary_sink`.

use super::{Areas, DeformationSummary, PairEvidence, Summary};
use crate::file::replace_or_leave;
use gridweave_runtime::ros::{Evidence, MapAgreement, MapDeformation, RobotFrames, UnmergedRobot, Verdicts};
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The parameters of `summary_sink`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SummaryParameters {
    /// The JSON file to write. An existing file is replaced.
    file: PathBuf,
    /// Whether the file is left as `FILE.part` when it is whole: the command renames the files of all stages together.
    /// Set by the command.
    leave_part: bool,
}

impl Parameters for SummaryParameters {}

/// The kind `summary_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "summary_sink",
        "Writes the result of a merge to a JSON file, at the end of the run.",
        SummarySink::new,
    )
    .inputs("frames", "the robots' map frames", SummarySink::frames)
    .optional_inputs("verdicts", "the outcome of each pair of robots", SummarySink::verdicts)
    .optional_inputs("evidence", "the agreement of the maps of each pair", SummarySink::evidence)
    .optional_inputs("agreement", "the agreement of the fused maps", SummarySink::agreement)
    .optional_inputs("deformation", "the deformations of the maps", SummarySink::deformation)
    .optional_inputs(
        "localised",
        "robots that have nothing to be merged, with the reason; listed even if no robot has a map frame",
        SummarySink::localised,
    )
    .finish(SummarySink::write)
    .build()
}

/// Stores the latest message of each input.
struct SummarySink {
    file: PathBuf,
    leave_part: bool,
    /// The stage at the other end of each wire.
    from: Vec<String>,
    summary: Summary,
    /// The agreement of the maps of each pair, robots a and b.
    evidence: BTreeMap<(String, String), PairEvidence>,
    /// Why robots have nothing to be merged.
    localised: BTreeMap<String, String>,
}

impl SummarySink {
    fn new(SummaryParameters { file, leave_part }: SummaryParameters, context: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = "write the summary";
            return Err(StageError::new(doing, "it has no file").with_help("give --summary FILE or file = \"FILE\""));
        }
        let from = context.inputs.iter().map(|wire| wire.from.clone()).collect();
        let (summary, evidence, localised) = Default::default();
        Ok(Self { file, leave_part, from, summary, evidence, localised })
    }

    fn frames(&mut self, frames: Received<'_, RobotFrames>, _: &Output<()>) -> Result<(), StageError> {
        self.summary.set_frames(&frames);
        Ok(())
    }

    fn verdicts(&mut self, verdicts: Received<'_, Verdicts>, _: &Output<()>) -> Result<(), StageError> {
        self.summary.set_verdicts(&verdicts);
        Ok(())
    }

    fn evidence(&mut self, evidence: Received<'_, Evidence>, _: &Output<()>) -> Result<(), StageError> {
        let of_pair = PairEvidence::from(&*evidence);
        let Evidence { a, b, .. } = evidence.into_content();
        self.evidence.insert((a, b), of_pair);
        Ok(())
    }

    fn agreement(&mut self, agreement: Received<'_, MapAgreement>, _: &Output<()>) -> Result<(), StageError> {
        let stage = self.from.get(agreement.wire()).cloned().unwrap_or_default();
        self.summary.areas.insert(stage, Areas::from(&*agreement));
        Ok(())
    }

    fn deformation(&mut self, deformation: Received<'_, MapDeformation>, _: &Output<()>) -> Result<(), StageError> {
        // The deformation of an empty map has no nodes.
        if !deformation.nodes.is_empty() {
            self.summary.deformations.insert(deformation.robot.clone(), DeformationSummary::from(&*deformation));
        }
        Ok(())
    }

    fn localised(&mut self, localised: Received<'_, UnmergedRobot>, _: &Output<()>) -> Result<(), StageError> {
        let UnmergedRobot { robot, reason } = localised.into_content();
        self.localised.insert(robot, reason);
        Ok(())
    }

    fn write(&mut self, _: &Output<()>) -> Result<(), StageError> {
        for (robot, reason) in std::mem::take(&mut self.localised) {
            if !self.summary.frames.contains_key(&robot) {
                self.summary.unmerged.entry(robot).or_insert(reason);
            }
        }
        for pair in &mut self.summary.alignments {
            pair.evidence = self.evidence.get(&(pair.a.clone(), pair.b.clone())).copied();
        }
        let failed = |cause: &dyn std::fmt::Display| {
            StageError::new(format!("write the summary {}", self.file.display()), cause)
        };
        let text = serde_json::to_string_pretty(&self.summary).map_err(|error| failed(&error))? + "\n";
        replace_or_leave(&[(&self.file, text.as_bytes())], self.leave_part).map_err(|error| failed(&error))
    }
}

//! Sinks that are added to a run for its options: the summary, the merged map as a file, and its picture. They read
//! messages by their types, whatever stages send them.

use super::options::RunOptions;
use crate::merge_text::short;
use crate::status::BadUse;
use crate::summary::RunSummary;
use anyhow::{Context, Result, bail};
use gridweave_logs::summary::Summary;
use gridweave_logs::{map_file, picture, summary};
use gridweave_runtime::engine::{PrivateFolder, RunReport};
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use gridweave_runtime::stage::{InputPort, OutputPort, StageKind};
use gridweave_stages::merge::map_placer;
use std::path::{Path, PathBuf};

/// The topic of the merged map.
const MERGED: &str = "/map";
/// The topic of a robot's map in the merged frame.
const PLACED: &str = "/{robot}/merged_map";
/// The port of robots that localise in one map, and have nothing to be merged.
const LOCALISED: &str = "localised";
/// The process that the sinks share where stages have processes.
const PROCESS: &str = "results";

/// The added sinks of a run.
pub(super) struct ResultSinks {
    /// The file of the summary, to which the command adds the statistics of the stages. `None` if nothing is merged.
    summary: Option<PathBuf>,
    /// Number of files of the other sinks.
    files: u64,
    _folder: PrivateFolder,
}

impl ResultSinks {
    /// Adds the sinks to a pipeline.
    ///
    /// # Errors
    /// A merged map is asked for, and no stage sends one.
    pub(super) fn attach(pipeline: &mut Pipeline, options: &RunOptions) -> Result<Self> {
        let folder = PrivateFolder::create().context("cannot make a folder for the summary")?;
        let file = folder.path().join("summary.json");
        // A robot whose map could not be built is known to the frame solver; robots in one map may be all there is.
        let is_attached = attach(pipeline, &summary::kind(), &file, |input, _, output| {
            input.name != LOCALISED || output.name == LOCALISED
        })?;
        let mut files = 0;
        if let Some(picture) = &options.picture {
            picture::check_format(picture).map_err(|error| BadUse(error.to_string()))?;
            // Only a picture needs the map of each robot in the merged frame.
            pipeline.attach(&map_placer::kind(), toml::Table::new(), PROCESS, |input, from, _| {
                input.name != "map" || from.kind.inputs.is_empty()
            });
        }
        for (kind, asked, topics) in [
            (map_file::kind(), &options.map, [MERGED].as_slice()),
            (picture::kind(), &options.picture, &[MERGED, PLACED]),
        ] {
            let Some(path) = asked else { continue };
            let is_taken = |output: &OutputPort| output.topic.is_some_and(|topic| topics.contains(&topic));
            if !is_merged(pipeline)
                || !attach(pipeline, &kind, path, |input, _, output| input.name != "map" || is_taken(output))?
            {
                let text = format!("the pipeline `{}` has no stage that sends a merged map on {MERGED}", pipeline.name);
                return Err(BadUse(format!("cannot write {}: {text}", path.display())).into());
            }
            files += 1;
        }
        Ok(Self { summary: is_attached.then_some(file), files, _folder: folder })
    }

    /// The file of the summary, which [`summary`](Self::summary) reads.
    pub(super) fn file(&self) -> Option<&Path> {
        self.summary.as_deref()
    }

    /// Reads the summary; `None` if the pipeline merges nothing.
    pub(super) fn summary(&self) -> Result<Option<Summary>> {
        let Some(file) = &self.summary else { return Ok(None) };
        let text = std::fs::read(file).context("cannot read the summary of the run")?;
        Ok(Some(serde_json::from_slice(&text).context("cannot read the summary of the run")?))
    }

    /// Checks that the merged map was written and drawn.
    pub(super) fn check_written(&self, summary: &RunSummary, report: &RunReport) -> Result<()> {
        let counts = report.stages.iter().filter_map(|stage| stage.counts.get("files"));
        if counts.sum::<u64>() < self.files {
            // No stage says of itself that it has sent nothing; why is in what was warned of.
            let warnings = summary.warning_texts();
            let unmerged = summary.merge.iter().flat_map(|merge| &merge.unmerged);
            let reasons = unmerged.map(|(robot, reason)| format!("\n  {robot}: {}", short(reason))).collect::<String>();
            bail!("there is no merged map to write or to draw: nothing was sent on {MERGED}{reasons}{warnings}");
        }
        Ok(())
    }
}

/// Whether a stage sends a merged map.
fn is_merged(pipeline: &Pipeline) -> bool {
    let mut outputs = pipeline.stages.iter().flat_map(|stage| &stage.kind.outputs);
    outputs.any(|output| output.topic == Some(MERGED))
}

fn attach(
    pipeline: &mut Pipeline,
    kind: &StageKind,
    file: &Path,
    takes: impl Fn(&InputPort, &StageSpec, &OutputPort) -> bool,
) -> Result<bool> {
    let parameters = toml::Table::from_iter([("file".to_owned(), toml::Value::from(super::text_of(file)?))]);
    Ok(pipeline.attach(kind, parameters, PROCESS, takes))
}

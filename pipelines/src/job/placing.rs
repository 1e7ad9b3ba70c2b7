//! The outputs of a run: its sinks leave them as parts, and they take their names together when all are whole.

use super::LOG_SINK;
use super::outputs::files_of;
use anyhow::Result;
use gridweave_logs::file::{leave, place, remove_left};
use gridweave_logs::map_file::image_beside;
use gridweave_logs::sink::close_log;
use gridweave_runtime::pipeline::{Pipeline, StageSpec};
use std::path::{Path, PathBuf};

/// The kinds of the sinks whose files may stay unwritten where there is nothing to write.
const SINKS: [&str; 3] = ["map_file_sink", "picture_sink", "truth_sink"];
/// The kind of those that write a file in any case.
const SUMMARY_SINK: &str = "summary_sink";
/// The kind of those whose file has an image beside it.
const MAP_SINK: &str = "map_file_sink";

/// The files that the sinks of a run leave as parts.
pub(crate) struct Outputs {
    logs: Vec<PathBuf>,
    summaries: Vec<PathBuf>,
    others: Vec<PathBuf>,
}

impl Outputs {
    /// Lets the sinks of a pipeline leave their files as parts, but for a sink of the summary whose file the command
    /// itself reads, `read`.
    pub(crate) fn of(pipeline: &mut Pipeline, read: Option<&Path>) -> Self {
        let is_sink = |kind: &str| [LOG_SINK, SUMMARY_SINK].contains(&kind) || SINKS.contains(&kind);
        let is_read = |stage: &StageSpec| read.is_some() && file_of(stage).map(Path::new) == read;
        let is_left = |stage: &&mut StageSpec| is_sink(stage.kind.name) && !is_read(stage);
        for stage in pipeline.stages.iter_mut().filter(is_left) {
            stage.parameters.insert("leave_part".to_owned(), true.into());
        }
        let images = files_of(pipeline, MAP_SINK, "file").into_iter().map(|map| image_beside(&map));
        let others = SINKS.iter().flat_map(|kind| files_of(pipeline, kind, "file"));
        let mut summaries = files_of(pipeline, SUMMARY_SINK, "file");
        summaries.retain(|summary| Some(summary.as_path()) != read);
        Self { logs: files_of(pipeline, LOG_SINK, "file"), summaries, others: images.chain(others).collect() }
    }

    /// Puts the files in their places after the run has ended well, together with the summary, its path and its text.
    /// If one cannot be written, none is replaced.
    pub(crate) fn place(&self, summary: Option<(&Path, &str)>) -> Result<()> {
        let written: Vec<(&Path, &[u8])> = summary.iter().map(|(path, text)| (*path, text.as_bytes())).collect();
        leave(&written)?;
        let of_sinks = paths(&self.summaries).chain(paths(&self.logs));
        let needed: Vec<&Path> = written.iter().map(|(path, _)| *path).chain(of_sinks).collect();
        let placed = place(&needed, &paths(&self.others).collect::<Vec<_>>());
        if placed.is_err() {
            remove_left(&written.iter().map(|(path, _)| *path).collect::<Vec<_>>());
        }
        Ok(placed?)
    }

    /// Ends the files of a run that failed for this `reason`. Logs whose sinks were killed are closed with it; a log
    /// takes its name if no file is there. What else was written is removed. Files of other runs are locked, and what
    /// an earlier killed run had left was removed when this run began.
    pub(crate) fn close(&self, reason: &str) {
        for log in &self.logs {
            match close_log(log, reason) {
                Ok(Some(closed)) => tracing::info!("the incomplete log {} is in {}", log.display(), closed.display()),
                Ok(None) => {}
                Err(error) => tracing::warn!("cannot close the log {}: {error}", log.display()),
            }
        }
        remove_left(&paths(&self.summaries).chain(paths(&self.others)).collect::<Vec<_>>());
    }
}

/// The file that a sink writes.
fn file_of(sink: &StageSpec) -> Option<&str> {
    sink.parameters.get("file")?.as_str()
}

fn paths(paths: &[PathBuf]) -> impl Iterator<Item = &Path> {
    paths.iter().map(PathBuf::as_path)
}

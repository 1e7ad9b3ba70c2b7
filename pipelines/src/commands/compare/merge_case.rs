//! A run of one pipeline on one log with one seed, in a separate process.

use super::cases::Case;
use super::measure::Usage;
use super::score::Scored;
use crate::status::BadUse;
use anyhow::{Context, Result};
use gridweave_runtime::engine::processes::Launch;
use gridweave_runtime::pipeline::Overrides;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};

/// Exit statuses of a complete run: all robots merged, and not all merged.
const COMPLETE: [i32; 2] = [0, 3];

/// A run to do.
pub(super) struct Merge<'a> {
    /// Index of the pipeline.
    pub(super) pipeline: usize,
    /// File or name of the pipeline.
    pub(super) file: &'a Path,
    /// Index of the case.
    pub(super) case: usize,
    pub(super) seed: u64,
}

/// Result of a run.
#[derive(Debug)]
pub(super) struct MergeResult {
    pub(super) pipeline: usize,
    pub(super) case: usize,
    pub(super) seed: u64,
    /// Outcome of each robot, or why the run has failed.
    pub(super) robots: Result<Vec<Scored>, String>,
    /// Time and memory, if they were measured.
    pub(super) usage: Option<Usage>,
}

impl Merge<'_> {
    /// Runs the pipeline with its outputs in `folder`, which is removed. A run that fails is a result.
    ///
    /// # Errors
    /// The run cannot be started, or its summary cannot be compared with the truth.
    pub(super) fn run(&self, case: &Case, folder: &Path) -> Result<MergeResult> {
        fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let [summary, usage, messages] = ["summary.json", "usage.json", "stderr.txt"].map(|name| folder.join(name));
        let stderr = File::create(&messages).with_context(|| format!("cannot write {}", messages.display()))?;
        let Launch { program, arguments } = Launch::this_program().context("cannot find the program itself")?;
        let seed = self.seed.to_string();
        let output = folder.join("out.mcap");
        let mut command = Command::new(&program);
        command.args(arguments);
        command.args([OsStr::new("measure"), "--usage".as_ref(), usage.as_os_str(), "--".as_ref()]);
        command.args([OsStr::new("run"), self.file.as_os_str(), "--input".as_ref(), case.log.as_os_str()]);
        command.args([OsStr::new("--output"), output.as_os_str(), "--summary".as_ref(), summary.as_os_str()]);
        command.args(["--results-only", "--seed", &seed]);
        if let Some(reference) = &case.reference {
            command.args(["--reference", reference]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        let started = command.status();
        started.with_context(|| format!("cannot start {}", program.display()))?;

        let usage: Option<Usage> = fs::read(&usage).ok().and_then(|text| serde_json::from_slice(&text).ok());
        let robots = match usage.as_ref().map(|usage| &usage.end) {
            Some(Ok(status)) if COMPLETE.contains(status) => {
                let scored = case.truth.score(&summary);
                Ok(scored.with_context(|| format!("{} on {}", self.file.display(), case.name))?)
            }
            Some(Err(end)) => Err(end.clone()),
            _ => Err(failure(&messages)),
        };
        fs::remove_dir_all(folder).with_context(|| format!("cannot remove the folder {}", folder.display()))?;
        Ok(MergeResult { pipeline: self.pipeline, case: self.case, seed: self.seed, robots, usage })
    }
}

/// The reason of a failure from what a run has written to standard error: the first line that begins with `error`, or
/// the last line.
fn failure(messages: &Path) -> String {
    let messages = fs::read(messages).unwrap_or_default();
    let messages = String::from_utf8_lossy(&messages);
    let lines = || messages.lines().map(str::trim).filter(|line| !line.is_empty());
    let line = lines().find(|line| line.starts_with("error")).or_else(|| lines().next_back());
    line.unwrap_or("it has reported no error").to_owned()
}

/// Settings for the input and output of a run, as `gridweave run` makes them.
pub(super) fn overrides(log: &Path, output: &Path) -> Result<Overrides, BadUse> {
    let text = |path: &Path| match path.to_str() {
        Some(text) => Ok(text.to_owned()),
        None => Err(BadUse(format!("the path {} is not UTF-8", path.display()))),
    };
    let mut overrides = Overrides::default();
    overrides.set_for_kind("mcap_source", "files", vec![text(log)?]);
    overrides.set_for_kind("mcap_sink", "file", text(output)?);
    Ok(overrides)
}

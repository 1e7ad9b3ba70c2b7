//! One pipeline on one log with one seed, in a process of its own.

use super::cases::Case;
use super::measure::Usage;
use super::score::Scored;
use crate::status::BadUse;
use anyhow::{Context, Result};
use gridweave_runtime::pipeline::Overrides;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};

/// Exit statuses of a run that has come to its end: done, and done but for what could not be merged.
const ENDED: [i32; 2] = [0, 3];

/// What is to be run.
pub(super) struct Merge<'a> {
    /// The number of the pipeline.
    pub(super) pipeline: usize,
    /// Its file or name.
    pub(super) file: &'a Path,
    /// The number of the case.
    pub(super) case: usize,
    pub(super) seed: u64,
}

/// How that came out.
#[derive(Debug)]
pub(super) struct MergeResult {
    pub(super) pipeline: usize,
    pub(super) case: usize,
    pub(super) seed: u64,
    /// What became of the robots, or why the run has failed.
    pub(super) robots: Result<Vec<Scored>, String>,
    /// What it has taken, if that is known.
    pub(super) usage: Option<Usage>,
}

impl Merge<'_> {
    /// Runs the pipeline, with a folder for what it writes, which is removed. A run that fails is a result.
    ///
    /// # Errors
    /// It cannot be run at all, or what it has found cannot be held against the truth.
    pub(super) fn run(&self, case: &Case, folder: &Path) -> Result<MergeResult> {
        fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let (summary, usage, said) = (folder.join("summary.json"), folder.join("usage.json"), folder.join("said.txt"));
        let said_file = File::create(&said).with_context(|| format!("cannot write {}", said.display()))?;
        let program = std::env::current_exe().context("cannot find the program itself")?;
        let seed = self.seed.to_string();
        let output = folder.join("out.mcap");
        let mut command = Command::new(&program);
        command.args([OsStr::new("measure"), "--usage".as_ref(), usage.as_os_str(), "--".as_ref()]);
        command.args([OsStr::new("run"), self.file.as_os_str(), "--input".as_ref(), case.log.as_os_str()]);
        command.args([OsStr::new("--output"), output.as_os_str(), "--summary".as_ref(), summary.as_os_str()]);
        command.args(["--results-only", "--seed", &seed]);
        if let Some(reference) = &case.reference {
            command.args(["--reference", reference]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(said_file);
        let started = command.status();
        started.with_context(|| format!("cannot start {}", program.display()))?;

        let usage: Option<Usage> = fs::read(&usage).ok().and_then(|text| serde_json::from_slice(&text).ok());
        let robots = match usage.as_ref().map(|usage| &usage.end) {
            Some(Ok(status)) if ENDED.contains(status) => {
                let scored = case.truth.score(&summary);
                Ok(scored.with_context(|| format!("{} on {}", self.file.display(), case.name))?)
            }
            Some(Err(ended)) => Err(ended.clone()),
            _ => Err(failure(&said)),
        };
        fs::remove_dir_all(folder).with_context(|| format!("cannot remove the folder {}", folder.display()))?;
        Ok(MergeResult { pipeline: self.pipeline, case: self.case, seed: self.seed, robots, usage })
    }
}

/// What a run has said why it failed: the first line that says `error`, or the last line.
fn failure(said: &Path) -> String {
    let said = fs::read(said).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    let lines = || said.lines().map(str::trim).filter(|line| !line.is_empty());
    let line = lines().find(|line| line.starts_with("error")).or_else(|| lines().next_back());
    line.unwrap_or("it has said nothing").to_owned()
}

/// What a run is told of its input and output, as `gridweave run` puts it.
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

//! `gridweave stage` and `gridweave clean`: a process of a run, and the removal of what killed runs have left.

use crate::shipped;
use crate::status::Status;
use crate::terminal::print_line;
use anyhow::{Result, anyhow};
use clap::Args;
use gridweave_runtime::engine::{self, processes};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::path::PathBuf;

/// Arguments of `gridweave stage`.
#[derive(Debug, Args)]
pub(crate) struct StageArgs {
    /// The folder of the run.
    pub(crate) folder: PathBuf,
    /// The process: a name that stages of the pipeline have in `process`, or the name of a stage.
    pub(crate) process: String,
}

/// Runs one process of a run that a supervisor has started.
pub(crate) fn stage(args: &StageArgs, registry: &Registry) -> Result<Status> {
    let load = |path: &std::path::Path, registry: &Registry| {
        shipped::load(path, &Overrides::default(), registry).map_err(|error| error.to_string())
    };
    processes::run_process(&args.folder, &args.process, registry, load).map_err(|error| anyhow!(error))?;
    Ok(Status::Done)
}

/// Removes what killed runs have left.
pub(crate) fn clean() -> Result<Status> {
    let cleaned = engine::clean()?;
    for left in &cleaned {
        let megabytes = left.bytes as f64 / 1e6;
        let what = left.folder.display();
        print_line(format_args!("removed {what} with {} files of shared memory ({megabytes:.1} MB)", left.files))?;
    }
    if cleaned.is_empty() {
        print_line("nothing is left over")?;
    }
    Ok(Status::Done)
}

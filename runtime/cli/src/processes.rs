//! Runs of several processes: the process that a supervisor starts, and what killed runs leave behind.

use crate::Outcome;
use crate::args::StageArgs;
use crate::pipelines;
use anyhow::{Result, anyhow};
use gridweave_runtime::engine::{self, processes};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;

/// Runs one process of a run that a supervisor has started.
pub(crate) fn stage(args: &StageArgs, registry: &Registry) -> Result<Outcome> {
    let load = |path: &std::path::Path, registry: &Registry| {
        let pipeline = pipelines::load(path, &Overrides::default(), registry).map_err(|error| error.to_string())?;
        pipeline.ok_or_else(|| format!("the pipeline {} of the run cannot be used", path.display()))
    };
    processes::run_process(&args.folder, &args.process, registry, load).map_err(|error| anyhow!(error))?;
    Ok(Outcome::Done)
}

/// Removes what killed runs have left.
pub(crate) fn clean() -> Result<Outcome> {
    let cleaned = engine::clean()?;
    for left in &cleaned {
        let megabytes = left.bytes as f64 / 1e6;
        println!("removed {} with {} files of shared memory ({megabytes:.1} MB)", left.folder.display(), left.files);
    }
    if cleaned.is_empty() {
        println!("nothing is left over");
    }
    Ok(Outcome::Done)
}

//! `gridweave run`: runs a pipeline file or a shipped pipeline.

use crate::job::{Inputs, Job, RunOptions, STANDARD_VIEW, is_yaml};
use crate::status::{BadUse, Status};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::stage::Registry;
use std::path::PathBuf;

/// Arguments of `gridweave run`.
#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// A pipeline file, or the name of a shipped pipeline such as `tag_merge`.
    pub(crate) pipeline: PathBuf,
    /// A log to read (MCAP file or rosbag2 folder); several are merged by log time. ROBOT=LOG puts its topics and
    /// frames under the name of its robot. Pipelines for map files read the map of a robot (map_server YAML), those for
    /// topological maps the topological map of a robot (JSON).
    #[arg(short, long, value_name = "LOG")]
    pub(crate) input: Vec<PathBuf>,
    /// The log to write; FOLDER/, with a slash at the end, is a rosbag2 folder.
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: Option<PathBuf>,
    /// Show the run in the Foxglove app over a WebSocket on this address, by default 127.0.0.1:8765. Only programs of
    /// this machine can connect there; 0.0.0.0 lets others in.
    #[arg(long, value_name = "[HOST:]PORT", num_args = 0..=1, require_equals = true, default_missing_value = STANDARD_VIEW)]
    pub(crate) view: Option<String>,
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

/// Runs a pipeline file.
pub(crate) fn run(args: &RunArgs, registry: &Registry) -> Result<Status> {
    if let Some(output) = args.output.as_deref().filter(|output| is_yaml(output)) {
        let text = format!("`run` cannot write a log to {0}: for the merged map give --map {0}", output.display());
        return Err(BadUse(text).into());
    }
    let job = Job {
        pipeline: &args.pipeline,
        inputs: &args.input,
        kind: Inputs::of_run(&args.input)?,
        output: args.output.as_deref().into(),
        options: &RunOptions { view: args.view.clone(), ..args.options.clone() },
        registry,
    };
    job.run_and_print()
}

//! `gridweave demo`: simulates three robots, merges their maps, and evaluates the merge.

use crate::commands::simulate;
use crate::evaluate::evaluate;
use crate::job::{Inputs, Job, Output, RunOptions};
use crate::status::Status;
use crate::terminal::{print, print_line, width};
use anyhow::{Context, Result};
use clap::Args;
use gridweave_runtime::engine::EngineKind;
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::path::{Path, PathBuf};

/// Arguments of `gridweave demo`.
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// The folder to write to.
    #[arg(long, default_value = "demo", value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// Seed of the building and of the drives.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// The engine that runs the stages: single, threads, threads-ipc, or processes.
    #[arg(long, default_value_t = EngineKind::default())]
    pub(crate) engine: EngineKind,
}

/// Simulates, merges and evaluates; all files are in one folder.
pub(crate) fn demo(args: &DemoArgs, registry: &Registry) -> Result<Status> {
    let folder = &args.out;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let (log, truth) = (folder.join("robots.mcap"), folder.join("robots.truth.json"));
    print_line("simulating three robots in one building ...")?;
    let mut overrides = Overrides::default();
    overrides.seed = Some(args.seed);
    simulate::write_log(&log, &truth, overrides, registry)?;

    print_line("merging their maps ...\n")?;
    let options = RunOptions {
        summary: Some(folder.join("summary.json")),
        map: Some(folder.join("merged.yaml")),
        picture: Some(folder.join("merged.png")),
        engine: Some(args.engine),
        ..Default::default()
    };
    let merged = folder.join("merged.mcap");
    let inputs = [log];
    let job = Job {
        pipeline: Path::new("tag_merge"),
        inputs: &inputs,
        kind: Inputs::Logs,
        output: Output::Log(&merged),
        options: &options,
        registry,
    };
    let summary = job.run()?;
    print(summary.to_text(&[], width()))?;

    let evaluation = evaluate(&folder.join("summary.json"), &truth)?;
    print_line(format_args!("\nerrors against the truth:\n{}", evaluation.to_text(width())))?;
    print_line(format_args!("see {0}/merged.png, or open {0}/merged.mcap in Foxglove", folder.display()))?;
    Ok(match summary.has_unmerged() {
        true => Status::NotAllMerged,
        false => Status::Done,
    })
}

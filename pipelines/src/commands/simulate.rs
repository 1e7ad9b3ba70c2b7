//! `gridweave simulate`: simulates robots in a building, and writes a log and its truth.

use crate::job::progress::Progress;
use crate::job::{Outputs, RunOptions, check_outputs};
use crate::shipped;
use crate::status::{BadUse, Status};
use crate::terminal::print_line;
use anyhow::Result;
use clap::Args;
use gridweave_logs::truth;
use gridweave_runtime::engine::{self, EngineKind, RunReport};
use gridweave_runtime::pipeline::{Mode, Overrides};
use gridweave_runtime::stage::Registry;
use std::path::{Path, PathBuf};

/// Arguments of `gridweave simulate`.
#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// The log to write.
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: PathBuf,
    /// Write the truth here; by default beside the log, as LOG.truth.json.
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    /// Number of robots.
    #[arg(long)]
    pub(crate) robots: Option<u32>,
    /// Seed of the building and of the drives.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Set a parameter of the simulation; `gridweave kinds simulator` lists them.
    #[arg(long, value_name = "PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
}

/// Simulates robots, and writes a log and its truth.
pub(crate) fn simulate(args: &SimulateArgs, registry: &Registry) -> Result<Status> {
    let mut overrides = Overrides::default();
    overrides.seed = Some(args.seed);
    if let Some(robots) = args.robots {
        overrides.set_for_kind("simulator", "robots", i64::from(robots));
    }
    for setting in &args.set {
        overrides.set(&format!("simulator.{setting}")).map_err(|error| BadUse(error.to_string()))?;
    }
    let truth = args.truth.clone().unwrap_or_else(|| beside(&args.output));
    let report = write_log(&args.output, &truth, overrides, registry)?;
    let logged = report.stages.iter().filter(|stage| stage.kind == "mcap_sink");
    let messages: u64 = logged.map(|stage| stage.messages_in).sum();
    let (log, truth) = (args.output.display(), truth.display());
    print_line(format_args!("wrote {messages} messages to {log} and the truth to {truth}"))?;
    Ok(Status::Done)
}

/// Writes a simulated log and its truth.
pub(crate) fn write_log(log: &Path, truth: &Path, mut overrides: Overrides, registry: &Registry) -> Result<RunReport> {
    let path = log.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", log.display())))?;
    overrides.set_for_kind("mcap_sink", "file", path);
    let mut pipeline = shipped::load(Path::new("simulate"), &overrides, registry)?;
    let file = truth.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", truth.display())))?;
    let parameters = toml::Table::from_iter([("file".to_owned(), toml::Value::from(file))]);
    pipeline.attach(&truth::kind(), parameters, "truth", |_, _, _| true);
    check_outputs(&pipeline, None, &RunOptions::default())?;
    let outputs = Outputs::of(&mut pipeline, None);
    let progress = Progress::new(Mode::Replay);
    let report = engine::run(&pipeline, EngineKind::Threads, &progress);
    progress.finish();
    let placed = report.map_err(anyhow::Error::from).and_then(|report| outputs.place(None).map(|()| report));
    if let Err(error) = &placed {
        outputs.close(&error.to_string());
    }
    placed
}

/// `a/b.mcap` -> `a/b.truth.json`.
fn beside(log: &Path) -> PathBuf {
    log.with_extension("truth.json")
}

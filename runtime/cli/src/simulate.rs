//! `gridweave simulate`.

use crate::Outcome;
use crate::args::{BadUse, SimulateArgs};
use crate::pipelines;
use crate::progress::Progress;
use anyhow::{Context, Result};
use gridweave_runtime::engine::{self, EngineKind, RunReport};
use gridweave_runtime::pipeline::{Mode, Overrides};
use gridweave_runtime::stage::Registry;
use std::path::{Path, PathBuf};

/// Simulates robots, and writes a log and its truth.
pub(crate) fn simulate(args: &SimulateArgs, registry: &Registry) -> Result<Outcome> {
    let mut overrides = Overrides::default();
    overrides.seed = Some(args.seed);
    if let Some(robots) = args.robots {
        overrides.set_for_kind("simulator", "robots", i64::from(robots));
    }
    for setting in &args.set {
        overrides.set(&format!("simulator.{setting}")).map_err(|error| BadUse(error.to_string()))?;
    }
    let truth = args.truth.clone().unwrap_or_else(|| beside(&args.output));
    let Some(report) = write_log(&args.output, &truth, overrides, registry)? else { return Ok(Outcome::BadUse) };
    let messages: u64 = report.stages.iter().map(|stage| stage.messages_in).sum();
    println!("wrote {messages} messages to {} and the truth to {}", args.output.display(), truth.display());
    Ok(Outcome::Done)
}

/// Writes a simulated log and its truth. `None` if the settings are wrong, which has been said then.
pub(crate) fn write_log(
    log: &Path,
    truth: &Path,
    mut overrides: Overrides,
    registry: &Registry,
) -> Result<Option<RunReport>> {
    let path = log.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", log.display())))?;
    overrides.set_for_kind("mcap_sink", "file", path);
    let Some(pipeline) = pipelines::load(Path::new("simulate"), &overrides, registry)? else { return Ok(None) };
    let progress = Progress::new(Mode::Replay);
    let report = engine::run(&pipeline, EngineKind::Threads, &progress);
    progress.finish();
    let report = report?;
    for (_, result) in report.results("simulator") {
        let text = serde_json::to_string_pretty(result)? + "\n";
        std::fs::write(truth, text).with_context(|| format!("cannot write the truth {}", truth.display()))?;
    }
    Ok(Some(report))
}

/// `a/b.mcap` -> `a/b.truth.json`.
fn beside(log: &Path) -> PathBuf {
    log.with_extension("truth.json")
}

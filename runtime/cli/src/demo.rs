//! `gridweave demo`: three simulated robots, from their logs to one map and its errors.

use crate::Outcome;
use crate::args::{DemoArgs, RunOptions};
use crate::evaluate::evaluate;
use crate::run::Job;
use crate::simulate;
use anyhow::{Context, Result};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::path::Path;

/// Simulates, merges, evaluates, and leaves all files in one folder.
pub(crate) fn demo(args: &DemoArgs, registry: &Registry) -> Result<Outcome> {
    let folder = &args.out;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let (log, truth) = (folder.join("robots.mcap"), folder.join("robots.truth.json"));
    println!("simulating three robots in one building ...");
    let mut overrides = Overrides::default();
    overrides.seed = Some(args.seed);
    if simulate::write_log(&log, &truth, overrides, registry)?.is_none() {
        return Ok(Outcome::BadUse);
    }

    println!("merging their maps ...\n");
    let options = RunOptions {
        summary: Some(folder.join("summary.json")),
        map: Some(folder.join("merged.yaml")),
        picture: Some(folder.join("merged.png")),
        engine: Some(args.engine),
        ..Default::default()
    };
    let merged = folder.join("merged.mcap");
    let inputs = [log];
    let job =
        Job { pipeline: Path::new("tag_merge"), inputs: &inputs, output: Some(&merged), options: &options, registry };
    let Some(summary) = job.run()? else { return Ok(Outcome::BadUse) };
    print!("{}", summary.to_text());

    let evaluation = evaluate(&folder.join("summary.json"), &truth)?;
    println!("\nerrors against the truth:\n{}", evaluation.to_text());
    println!("look at {0}/merged.png, or open {0}/merged.mcap in Foxglove", folder.display());
    Ok(match summary.has_unmerged() {
        true => Outcome::NotAllMerged,
        false => Outcome::Done,
    })
}

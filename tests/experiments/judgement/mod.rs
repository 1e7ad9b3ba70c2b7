//! Fits the weights of the judgement (`stages/registration/judgement/weights.rs`) to pairs of maps.
//!
//! Each pair is searched, refined and compared on the way that ships. A conditional logit over its places, and none of
//! them, is fitted to which is right, and another one to which of a place and its aliases is. Pairs of different
//! buildings weigh as much together as pairs that belong together: the probability is that of a pair of which either is
//! as likely. What the tables and curves show is cross-validated by place: no place is judged by weights that it took
//! part in.

mod cross_validation;
mod examples;
mod fit;
mod report;

use super::results::Results;
use anyhow::{Context, Result};
use clap::Args;
use gridweave_runtime::stage::Registry;
use std::path::PathBuf;

/// Arguments of the experiment `fit-judgement`.
#[derive(Debug, Args)]
pub(super) struct FitJudgementArgs {
    /// Folders of map files and of logs, as those of `map-pairs`.
    folders: Vec<PathBuf>,
    /// Fit to the examples in this file, which an earlier fit has written, and not to maps.
    #[arg(long, value_name = "FILE", conflicts_with = "folders")]
    from: Option<PathBuf>,
    /// Pairs of parts of maps of different buildings.
    #[arg(long, default_value_t = 2000)]
    unrelated: u64,
    /// Simulated worlds of any kind, of the seeds on which parameters are chosen.
    #[arg(long, default_value_t = 240)]
    worlds: u64,
    /// So many simulated worlds more of each kind whose parts are alike, for the aliases.
    #[arg(long, default_value_t = 120)]
    alike: u64,
    /// Pairs of simulated buildings whose rooms are the same, down to their equipment, with two robots in each.
    #[arg(long, default_value_t = 80)]
    same_rooms: u64,
    /// Pairs of maps of different simulated worlds.
    #[arg(long, default_value_t = 1000)]
    simulated: u64,
    /// Seed of the pairs, parts and rotations.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Into so many parts are the places dealt for the cross-validation.
    #[arg(long, default_value_t = 8)]
    folds: usize,
    /// The file that the weights are written to; none of them are written without it.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

/// Does the experiment.
pub(super) fn run(args: &FitJudgementArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let examples = match &args.from {
        Some(file) => examples::read(file)?,
        None => examples::gather(args, registry)?,
    };
    results.file("judgement_examples.jsonl", examples::to_lines(&examples)?.as_bytes())?;
    let judged = cross_validation::judge(&examples, args.folds)?;
    report::report(&examples, &judged, results)?;
    let weights = fit::Weights::fit(&examples.iter().collect::<Vec<_>>())?;
    let source = report::weights_source(&weights, &examples);
    match &args.write {
        Some(file) => std::fs::write(file, source).with_context(|| format!("cannot write {}", file.display())),
        None => results.file("judgement_weights.rs", source.as_bytes()),
    }
}

//! To come.
use super::results::Results;
use anyhow::Result;
use clap::Args;

/// What `gridweave experiment localization` is told.
#[derive(Debug, Args)]
pub(super) struct LocalizationArgs {
    /// How many worlds or drives, each with a seed of its own.
    #[arg(long, default_value_t = 50)]
    seeds: u64,
}

/// Does the experiment.
pub(super) fn run(args: &LocalizationArgs, results: &mut Results) -> Result<()> {
    anyhow::bail!("to come")
}

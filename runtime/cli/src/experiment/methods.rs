//! To come.
use super::results::Results;
use anyhow::Result;
use clap::Args;
use gridweave_runtime::stage::Registry;

/// What `gridweave experiment methods` is told.
#[derive(Debug, Args)]
pub(super) struct MethodsArgs {
    /// How many worlds or drives, each with a seed of its own.
    #[arg(long, default_value_t = 50)]
    seeds: u64,
}

/// Does the experiment.
pub(super) fn run(args: &MethodsArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    anyhow::bail!("to come")
}

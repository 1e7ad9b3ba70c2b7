//! What all commands that run a pipeline have in common.

use clap::Args;
use gridweave_runtime::engine::EngineKind;
use std::path::PathBuf;

/// What all commands that run a pipeline have in common.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RunOptions {
    /// Write the result as JSON to this file: frames, alignments, what could not be merged and why.
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// Write the merged map as a map file (map_server YAML, with the image beside it).
    #[arg(long, value_name = "FILE.yaml")]
    pub(crate) map: Option<PathBuf>,
    /// Draw the merged maps, each robot's walls in a colour of its own.
    #[arg(long, value_name = "FILE.png")]
    pub(crate) picture: Option<PathBuf>,
    /// What runs the stages: single, threads (the default for a replay), threads-ipc, or processes (for a live pipeline).
    /// The result is the same.
    #[arg(long)]
    pub(crate) engine: Option<EngineKind>,
    /// Seeds all randomness.
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// The robot whose map frame is the world; if none is given, the first by name when the first two are merged.
    #[arg(long, value_name = "ROBOT")]
    pub(crate) reference: Option<String>,
    /// Read map files by their thresholds to the letter, also where these make unknown cells free or leave no walls.
    #[arg(long)]
    pub(crate) literal_thresholds: bool,
    /// Set a parameter of a stage.
    #[arg(long, value_name = "STAGE.PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
    /// Leave the input's messages out of the output.
    #[arg(long)]
    pub(crate) results_only: bool,
    /// Print the summary as JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

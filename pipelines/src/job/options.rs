//! What all commands that run a pipeline have in common.

use super::ReadingOptions;
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
    /// Draw the merged maps, each robot's walls in a colour of its own, as FILE.png, .svg or .pdf; `gridweave render` draws more.
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
    /// Where the map frame of a robot lies, about: metres and radians, in the frame of the reference or in one in which the
    /// pose of another robot is given, too. The standard deviations are 1 m and 0.2 radians unless given.
    #[arg(long, value_name = "ROBOT=X,Y,YAW[,STDDEV[,YAW_STDDEV]]", allow_hyphen_values = true)]
    pub(crate) initial: Vec<String>,
    /// Accept the place with this number that a refusal has listed for a robot and the reference; `initial` lays it by its
    /// initial pose without a look at the maps. ROBOT/ROBOT is the pair of these two.
    #[arg(long, value_name = "ROBOT=N")]
    pub(crate) accept: Vec<String>,
    /// Print all that speaks for and against the places of a robot.
    #[arg(long, value_name = "ROBOT")]
    pub(crate) explain: Vec<String>,
    /// Read map files by their thresholds to the letter, also where these make unknown cells free or leave no walls.
    #[arg(long)]
    pub(crate) literal_thresholds: bool,
    #[command(flatten)]
    pub(crate) reading: ReadingOptions,
    /// Set a parameter of a stage.
    #[arg(long, value_name = "STAGE.PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
    /// Leave the input's messages out of the output.
    #[arg(long)]
    pub(crate) results_only: bool,
    /// Where Foxglove is shown the run while it goes on, as `gridweave run` is told.
    #[arg(skip)]
    pub(crate) view: Option<String>,
    /// Print the summary as JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

//! Options of all commands that run a pipeline.

use super::ReadingOptions;
use clap::Args;
use gridweave_runtime::engine::EngineKind;
use std::path::PathBuf;

/// Options of all commands that run a pipeline.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RunOptions {
    /// Write the result as JSON to this file: frames, alignments, and robots that could not be merged, with reasons.
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// Write the merged map as a map file (map_server YAML, with the image beside it).
    #[arg(long, value_name = "FILE.yaml")]
    pub(crate) map: Option<PathBuf>,
    /// Draw the merged maps, the walls of each robot in another colour, as FILE.png, .svg or .pdf; `gridweave render`
    /// has more options.
    #[arg(long, value_name = "FILE.png")]
    pub(crate) picture: Option<PathBuf>,
    /// The engine that runs the stages: single, threads (the default for a replay), threads-ipc, or processes (for a
    /// live pipeline). The result is the same.
    #[arg(long)]
    pub(crate) engine: Option<EngineKind>,
    /// Seed of all random numbers.
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// The robot whose map frame is the world; by default the first by name when the first two are merged.
    #[arg(long, value_name = "ROBOT")]
    pub(crate) reference: Option<String>,
    /// The approximate pose of a robot's map frame, metres and radians, in the frame of the reference or in one in
    /// which the pose of another robot is also given. The standard deviations are 1 m and 0.2 radians by default.
    #[arg(long, value_name = "ROBOT=X,Y,YAW[,STDDEV[,YAW_STDDEV]]", allow_hyphen_values = true)]
    pub(crate) initial: Vec<String>,
    /// Accept the hypothesis with this number that a refusal has listed for a robot and the reference; `initial` takes
    /// its initial pose without comparing the maps. ROBOT/ROBOT is the pair of these two.
    #[arg(long, value_name = "ROBOT=N")]
    pub(crate) accept: Vec<String>,
    /// Print the evidence for and against the hypotheses of a robot.
    #[arg(long, value_name = "ROBOT")]
    pub(crate) explain: Vec<String>,
    /// Apply the thresholds of map files literally, even where these make unknown cells free or leave no walls.
    #[arg(long)]
    pub(crate) literal_thresholds: bool,
    /// The side of a cell of a robot's maps, metres, instead of the resolution in its map file or log.
    #[arg(long, value_name = "ROBOT=METRES")]
    pub(crate) resolution: Vec<String>,
    /// The pose of a robot's lidar on its base, metres and radians, instead of that in the log's tf. A fourth number is
    /// the roll: 3.1416 for a lidar that is mounted upside down.
    #[arg(long, value_name = "ROBOT=X,Y,YAW[,ROLL]", allow_hyphen_values = true)]
    pub(crate) lidar: Vec<String>,
    #[command(flatten)]
    pub(crate) reading: ReadingOptions,
    /// Set a parameter of a stage.
    #[arg(long, value_name = "STAGE.PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
    /// Leave the input's messages out of the output.
    #[arg(long)]
    pub(crate) results_only: bool,
    /// The address of the view for Foxglove, from `gridweave run`.
    #[arg(skip)]
    pub(crate) view: Option<String>,
    /// Print the summary as JSON instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

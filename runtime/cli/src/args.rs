//! What the command line may say.

use crate::experiment::ExperimentArgs;
use crate::golden::GoldenArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use gridweave_runtime::engine::EngineKind;
use std::path::PathBuf;

/// Merges the maps of several robots that explore one building, each with a map frame of its own.
///
/// Exit status: 0 done, 1 failed, 2 bad use, 3 done but something could not be merged.
#[derive(Debug, Parser)]
#[command(name = "gridweave", version, max_term_width = 110)]
pub(crate) struct Cli {
    /// Say more on standard error.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a pipeline.
    Run(RunArgs),
    /// Merge the maps in logs, or map files, by the shipped pipeline that fits.
    Merge(MergeArgs),
    /// Check pipeline files and show everything that is wrong with them.
    Check(CheckArgs),
    /// Show which stages a pipeline has and how they are wired.
    Graph(GraphArgs),
    /// List the stage kinds with their ports and parameters.
    Kinds(KindsArgs),
    /// Show what is in logs: topics, types, counts, times, robots.
    Info(InfoArgs),
    /// Compare a summary with the truth.
    Evaluate(EvaluateArgs),
    /// Simulate robots in a building, and write a log and its truth.
    Simulate(SimulateArgs),
    /// Simulate three robots, merge their maps, and compare with the truth.
    Demo(DemoArgs),
    /// Run every stage alone on stored input, and compare what it sends with what is expected.
    Golden(GoldenArgs),
    /// Play logs into a live pipeline, as the robots would send them.
    Play(PlayArgs),
    /// Record links of a run that is going on.
    Record(RecordArgs),
    /// Print the messages of a link of a run that is going on, as they pass.
    Tap(TapArgs),
    /// Show what the stages of a run that is going on do.
    Top(TopArgs),
    /// Remove what killed runs have left in shared memory and in temporary folders. Runs that live are not touched.
    Clean,
    /// Run one process of a pipeline on the engine `processes`, which starts it.
    #[command(hide = true)]
    Stage(StageArgs),
    /// Repeat the experiments of the papers, and measure how far the stages hold.
    Experiment(ExperimentArgs),
}

/// The command line asks for something that cannot be.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BadUse(pub(crate) String);

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

#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// A pipeline file, or the name of a shipped pipeline such as `tag_merge`.
    pub(crate) pipeline: PathBuf,
    /// A log to read (MCAP file or rosbag2 folder); several are merged by log time. Or, for a pipeline that reads map files,
    /// the map of a robot (map_server YAML).
    #[arg(short, long, value_name = "LOG")]
    pub(crate) input: Vec<PathBuf>,
    /// The log to write.
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// Logs (MCAP files or rosbag2 folders), or map files (map_server YAML), each the map of a robot that is called as the
    /// file.
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// What to write: a log or, when it is called FILE.yaml, the merged map alone (map_server YAML, with the image beside
    /// it).
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Pipeline files, or names of shipped pipelines.
    #[arg(required = true, value_name = "PIPELINE")]
    pub(crate) pipelines: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct GraphArgs {
    /// A pipeline file, or the name of a shipped pipeline.
    pub(crate) pipeline: PathBuf,
    /// How to show it.
    #[arg(long, value_enum, default_value_t = GraphFormat::Text)]
    pub(crate) format: GraphFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GraphFormat {
    /// A list for people.
    Text,
    /// A Mermaid flowchart, as GitHub draws it.
    Mermaid,
    /// A Graphviz graph.
    Dot,
    /// A pipeline file in which nothing is left to defaults.
    Toml,
}

#[derive(Debug, Args)]
pub(crate) struct KindsArgs {
    /// Only this kind.
    pub(crate) kind: Option<String>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// Logs (MCAP files or rosbag2 folders).
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Take the topic patterns of this pipeline to tell robots apart.
    #[arg(long)]
    pub(crate) pipeline: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// What `--summary` has written.
    pub(crate) summary: PathBuf,
    /// The true frames, as `gridweave simulate` writes them.
    #[arg(long)]
    pub(crate) truth: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// The log to write.
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: PathBuf,
    /// Write the truth here; by default beside the log, as LOG.truth.json.
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    /// How many robots.
    #[arg(long)]
    pub(crate) robots: Option<u32>,
    /// Another seed makes another building and other drives.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Set a parameter of the simulation; `gridweave kinds simulator` lists them.
    #[arg(long, value_name = "PARAMETER=VALUE")]
    pub(crate) set: Vec<String>,
}

#[derive(Debug, Args)]
pub(crate) struct StageArgs {
    /// The folder of the run.
    pub(crate) folder: PathBuf,
    /// The process: a name that stages of the pipeline have in `process`, or a stage's name.
    pub(crate) process: String,
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// The folder to write to.
    #[arg(long, default_value = "demo", value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// Another seed makes another building and other drives.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// What runs the stages: single, threads, threads-ipc, or processes.
    #[arg(long, default_value_t = EngineKind::default())]
    pub(crate) engine: EngineKind,
}

/// Which of the runs that are going on is meant.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RunChoice {
    /// Which run, if there are several: the name of its pipeline, or its own name as `top` shows it.
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Wait for so many seconds until there is such a run.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    pub(crate) wait: f64,
}

/// What `gridweave play` is told.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// The logs: MCAP files, and folders of ROS 2 bags. Several are merged by log time.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// How much faster than they were recorded; 0 is as fast as the pipeline takes them.
    #[arg(long, default_value_t = 1.0)]
    pub(crate) rate: f64,
    /// Begin again at the end, with later log times, until interrupted.
    #[arg(long = "loop")]
    pub(crate) repeat: bool,
    /// Seconds from the first message at which to begin. The last map of each robot before that is sent first.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    pub(crate) start: f64,
    /// Seconds from the first message at which to end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) end: Option<f64>,
    /// The stage of the pipeline to send as, if it has several whose messages come from outside.
    #[arg(long, value_name = "NAME")]
    pub(crate) stage: Option<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// What `gridweave record` is told.
#[derive(Debug, Args)]
pub(crate) struct RecordArgs {
    /// The MCAP file to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Which links: STAGE.PORT, or STAGE for all its outputs; all links of the run if none is named.
    #[arg(value_name = "LINK")]
    pub(crate) links: Vec<String>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// What `gridweave tap` is told.
#[derive(Debug, Args)]
pub(crate) struct TapArgs {
    /// The link: STAGE.PORT, or STAGE if it has one output only.
    #[arg(value_name = "STAGE.PORT")]
    pub(crate) link: String,
    /// Print each message as a line of JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// End after so many messages.
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// What `gridweave top` is told.
#[derive(Debug, Args)]
pub(crate) struct TopArgs {
    /// Measure for one interval, print that, and end.
    #[arg(long)]
    pub(crate) once: bool,
    /// Print JSON, an object for each interval.
    #[arg(long)]
    pub(crate) json: bool,
    /// Seconds from one measurement to the next.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) interval: f64,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

//! `gridweave convert`: writes logs of any format as one MCAP file or ROS 1 bag.

use crate::job::{Inputs, Job, Output, ReadingOptions, RunOptions, is_yaml};
use crate::status::{BadUse, Status};
use crate::terminal::{eprint_line, print_line};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::stage::Registry;
use std::path::{Path, PathBuf};

/// The pipeline that passes logs on as they are.
const PIPELINE: &str = "cut";

/// Arguments of `gridweave convert`.
#[derive(Debug, Args)]
pub(crate) struct ConvertArgs {
    /// Logs (MCAP, SQLite of rosbag2, rosbag2 folders, ROS 1 bags), written as one, by log time. ROBOT=LOG puts the
    /// topics and frames of a log under the name of its robot.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) inputs: Vec<PathBuf>,
    /// The output: an MCAP file; a rosbag2 folder with one: an existing folder, or FOLDER/ with a slash at the end; or,
    /// for FILE.bag, a ROS 1 bag.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) reading: ReadingOptions,
}

/// Writes logs as one.
pub(crate) fn convert(args: &ConvertArgs, registry: &Registry) -> Result<Status> {
    Inputs::of_maps_or_logs(&args.inputs, "convert")?;
    let kind = Inputs::of_run(&args.inputs)?;
    if kind == Inputs::MapFiles || is_yaml(&args.output) {
        let text = "`convert` reads logs and writes an MCAP file or a ROS 1 bag; to merge map files: `gridweave merge A.yaml B.yaml -o OUT`";
        return Err(BadUse(text.to_owned()).into());
    }
    let options = RunOptions { reading: args.reading.clone(), ..Default::default() };
    let (pipeline, output) = (Path::new(PIPELINE), Output::Log(&args.output));
    let summary = Job { pipeline, inputs: &args.inputs, kind, output, options: &options, registry }.run()?;
    for line in summary.warning_lines() {
        eprint_line(line);
    }
    let messages: u64 = summary.stages.iter().filter_map(|stage| stage.counts.get("messages")).sum();
    print_line(format_args!("wrote {messages} messages to {}", args.output.display()))?;
    Ok(Status::Done)
}

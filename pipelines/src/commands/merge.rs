//! `gridweave merge`: maps are merged by the shipped pipeline that fits the inputs.

use crate::job::Job;
use crate::job::RunOptions;
use crate::job::{Inputs, Output, is_yaml};
use crate::status::{BadUse, Status};
use crate::terminal::say;
use anyhow::Result;
use clap::Args;
use gridweave_logs::info;
use gridweave_logs::names::{Convention, Input};
use gridweave_runtime::stage::{Registry, RobotTopics};
use std::path::{Path, PathBuf};

/// What `gridweave merge` is told.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// Logs (MCAP, SQLite of rosbag2, rosbag2 folders, ROS 1 bags); ROBOT=LOG puts the topics and frames of a log under the name
    /// of its robot. Or map files (map_server YAML), each the map of a robot that is called as the file.
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// What to write: a log (FOLDER/, with a slash behind it, is a rosbag2 folder) or, when it is called FILE.yaml, the merged
    /// map alone (map_server YAML, with the image beside it).
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

/// Merges the maps of logs or of map files.
pub(crate) fn merge(args: &MergeArgs, registry: &Registry) -> Result<Status> {
    let pipeline = match Inputs::of(&args.inputs)? {
        Inputs::TopologyFiles => "topology_file_merge",
        Inputs::Logs if holds_tags_alone(args)? => "tag_frames",
        Inputs::Logs => match &robots_to_draw(args)?[..] {
            [] => "auto_merge",
            robots => {
                let robots = robots.join(", ");
                say(format_args!(
                    "no map of {robots} was logged: drawn from scans, where a SLAM would do better (scan_merge)"
                ));
                "scan_merge"
            }
        },
        Inputs::MapFiles => "map_file_merge",
    };
    let (output, options) = match is_yaml(&args.output) {
        true => (Output::MapOnly, with_map(args)?),
        false => (Output::Log(&args.output), args.options.clone()),
    };
    Job { pipeline: Path::new(pipeline), inputs: &args.inputs, output, options: &options, registry }.run_and_print()
}

/// Whether logs hold tags and no map, so that frames are all that can come out, and no map is asked for. Logs that cannot be
/// read are told of by the run.
fn holds_tags_alone(args: &MergeArgs) -> Result<bool, BadUse> {
    if args.options.map.is_some() || args.options.picture.is_some() || is_yaml(&args.output) {
        return Ok(false);
    }
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let rules = args.options.reading.names.rules(Convention::ByRobot)?;
    Ok(info::holds_tags_alone(&inputs, &rules, &RobotTopics::default()).unwrap_or(false))
}

/// The robots that have scans and no map. Logs that cannot be read are told of by the run.
fn robots_to_draw(args: &MergeArgs) -> Result<Vec<String>, BadUse> {
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let rules = args.options.reading.names.rules(Convention::ByRobot)?;
    Ok(info::robots_to_draw(&inputs, &rules, &RobotTopics::default()).unwrap_or_default())
}

/// The options of a merge whose output is the map. An error if they speak of a log, which there is none of.
fn with_map(args: &MergeArgs) -> Result<RunOptions, BadUse> {
    let output = args.output.display();
    if let Some(map) = &args.options.map {
        let text = format!("{output} and {} would be the same map: leave --map out, or give -o a log", map.display());
        return Err(BadUse(text));
    }
    if args.options.results_only {
        let text = format!("--results-only says what to leave out of a log, and {output} is a map: leave it out");
        return Err(BadUse(text));
    }
    Ok(RunOptions { map: Some(args.output.clone()), ..args.options.clone() })
}

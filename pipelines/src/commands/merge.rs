//! `gridweave merge`: merges maps by the shipped pipeline that fits the inputs.

use crate::job::Job;
use crate::job::RunOptions;
use crate::job::{Inputs, Output, is_yaml};
use crate::status::{BadUse, Status};
use crate::terminal::eprint_line;
use anyhow::Result;
use clap::Args;
use gridweave_logs::info;
use gridweave_logs::names::{Input, TopicNaming};
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::{Registry, RobotTopics};
use std::path::{Path, PathBuf};

/// Arguments of `gridweave merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// Logs (MCAP, SQLite of rosbag2, rosbag2 folders, ROS 1 bags); ROBOT=LOG puts the topics and frames of a log under
    /// the name of its robot. Or map files (map_server YAML), one for each robot; the name of the file is that of the
    /// robot.
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// The output: a log (FOLDER/, with a slash at the end, is a rosbag2 folder, FILE.bag a ROS 1 bag) or, for
    /// FILE.yaml, only the merged map (map_server YAML, with the image beside it).
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

/// Merges the maps of logs or of map files.
pub(crate) fn merge(args: &MergeArgs, registry: &Registry) -> Result<Status> {
    let kind = Inputs::of(&args.inputs)?;
    let pipeline = args.pipeline()?;
    let (output, options) = match is_yaml(&args.output) {
        true => (Output::MapOnly, with_map(args)?),
        false => (Output::Log(&args.output), args.options.clone()),
    };
    Job { pipeline: Path::new(pipeline), inputs: &args.inputs, kind, output, options: &options, registry }
        .run_and_print()
}

impl MergeArgs {
    /// Finds the shipped pipeline that fits the inputs.
    pub(crate) fn pipeline(&self) -> Result<&'static str> {
        Ok(match Inputs::of(&self.inputs)? {
            Inputs::TopologyFiles => "topology_file_merge",
            Inputs::Logs if has_only_tags(self)? => "tag_frames",
            Inputs::Logs => match &robots_without_maps(self)?[..] {
                [] => "auto_merge",
                robots => {
                    let robots = list_in_words(robots);
                    eprint_line(format_args!("the log has no map of {robots}: maps are built from scans (scan_merge)"));
                    "scan_merge"
                }
            },
            Inputs::MapFiles => "map_file_merge",
        })
    }
}

/// Whether logs have tags and no maps, so that only frames can be estimated, and no map is asked for. Logs that cannot
/// be read are errors of the run.
fn has_only_tags(args: &MergeArgs) -> Result<bool, BadUse> {
    if args.options.map.is_some() || args.options.picture.is_some() || is_yaml(&args.output) {
        return Ok(false);
    }
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let rules = args.options.reading.names.rules(TopicNaming::ByRobot)?;
    Ok(info::holds_tags_alone(&inputs, &rules, &RobotTopics::default()).unwrap_or(false))
}

/// Finds the robots that have scans and no map. Logs that cannot be read are errors of the run.
fn robots_without_maps(args: &MergeArgs) -> Result<Vec<String>, BadUse> {
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::new(input)).collect();
    let rules = args.options.reading.names.rules(TopicNaming::ByRobot)?;
    Ok(info::robots_with_scans_only(&inputs, &rules, &RobotTopics::default()).unwrap_or_default())
}

/// Makes the options of a merge whose output is the map. Options that need a log are an error.
fn with_map(args: &MergeArgs) -> Result<RunOptions, BadUse> {
    let output = args.output.display();
    if let Some(map) = &args.options.map {
        let text = format!("{output} and {} would be the same map: omit --map, or give a log as -o", map.display());
        return Err(BadUse(text));
    }
    if args.options.results_only {
        let text = format!("--results-only needs a log as output, and {output} is a map: omit --results-only");
        return Err(BadUse(text));
    }
    Ok(RunOptions { map: Some(args.output.clone()), ..args.options.clone() })
}

//! The robots that a run should merge, by the channels of its logs.

use super::{Inputs, Job};
use crate::summary::RunSummary;
use gridweave_logs::info;
use gridweave_logs::names::{Input, TopicNaming};
use gridweave_runtime::pipeline::{Mode, Pipeline};

/// The kind of stage that builds maps.
const MAPPER: &str = "scan_mapper";
const NOTHING_USED: &str = "it has no map: none of its scans could be used. Its topic has no messages, or warnings say what is \
                            wrong with them";

/// Adds the robots of the logs to the summary of which maps should be built, and of whose scans none was used: no stage has
/// seen them.
pub(super) fn add_unused_robots(job: &Job<'_>, pipeline: &Pipeline, summary: &mut RunSummary) {
    let Some(merge) = summary.merge.as_mut().filter(|merge| !merge.frames.is_empty()) else { return };
    let builds_maps = pipeline.stages.iter().any(|stage| stage.kind.name == MAPPER);
    if job.kind != Inputs::Logs || pipeline.mode != Mode::Replay || !builds_maps {
        return;
    }
    let inputs: Vec<Input> = job.inputs.iter().map(|input| Input::new(input)).collect();
    // The run has read the logs by these rules, so they are right.
    let Ok(rules) = job.options.reading.names.rules(TopicNaming::ByRobot) else { return };
    for robot in info::robots_with_scans_only(&inputs, &rules, &pipeline.robots).unwrap_or_default() {
        if !merge.frames.contains_key(&robot) {
            merge.unmerged.entry(robot).or_insert_with(|| NOTHING_USED.to_owned());
        }
    }
}

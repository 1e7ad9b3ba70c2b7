//! The robots that a run should merge, by the channels of its logs.

use super::{Inputs, Job};
use crate::summary::RunSummary;
use gridweave_logs::info;
use gridweave_logs::names::{Input, TopicNaming};
use gridweave_runtime::pipeline::{Mode, Pipeline};

const MAPPER: &str = "scan_mapper";

/// Adds the robots of the logs to the summary that have topics for maps, or for scans of which maps are built, and of
/// which nothing was used: no stage has seen them.
pub(super) fn add_unused_robots(job: &Job<'_>, pipeline: &Pipeline, summary: &mut RunSummary) {
    let Some(merge) = summary.merge.as_mut().filter(|merge| !merge.frames.is_empty()) else { return };
    if job.kind != Inputs::Logs || pipeline.mode != Mode::Replay || !super::results::is_merged(pipeline) {
        return;
    }
    let inputs: Vec<Input> = job.inputs.iter().map(|input| Input::new(input)).collect();
    // The run has read the logs by these rules, so they are right.
    let Ok(rules) = job.options.reading.names.rules(TopicNaming::ByRobot) else { return };
    let builds_maps = pipeline.stages.iter().any(|stage| stage.kind.name == MAPPER);
    let mapped = info::robots_with_maps(&inputs, &rules, &pipeline.robots).unwrap_or_default();
    let scanned = match builds_maps {
        true => info::robots_with_scans_only(&inputs, &rules, &pipeline.robots).unwrap_or_default(),
        false => Vec::new(),
    };
    let of_maps = mapped.into_iter().map(|robot| (robot, "maps"));
    for (robot, data) in of_maps.chain(scanned.into_iter().map(|robot| (robot, "scans"))) {
        if !merge.frames.contains_key(&robot) {
            merge.unmerged.entry(robot).or_insert_with(|| {
                format!(
                    "it has no map: none of its {data} could be used. Its topic has no messages, or warnings say what is \
                     wrong with them"
                )
            });
        }
    }
}

//! A tag that one robot sees in a wrong place, as a reflection or a move of the tag makes it, does not spoil a merge.

use crate::support::{change_readings, evaluate, gridweave, json, moved_reading, place_in_map_2, simulate};
use gridweave_runtime::ros::{CommonTags, RosMessage, decode};
use nalgebra::Vector2;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Merges `log` in `folder`. Returns the last decision of the tag filter, and the measured outcome.
fn merge(folder: &Path, log: &str) -> (CommonTags, Value) {
    let args =
        ["run", "tag_merge", "--input", log, "--output", "out.mcap", "--results-only", "--summary", "summary.json"];
    gridweave(folder, &args).assert(0, &["merged 2 of 2"]);
    let output = fs::read(folder.join("out.mcap")).unwrap();
    let messages = mcap::MessageStream::new(&output).unwrap().map(Result::unwrap);
    let common = messages.filter(|message| schema_name(message) == CommonTags::NAME).last().unwrap();
    (decode(&common.data).unwrap(), evaluate(folder, "in.truth.json".as_ref()))
}

fn schema_name<'a>(message: &'a mcap::Message<'_>) -> &'a str {
    message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str())
}

#[test]
fn the_merge_is_right_and_the_tag_is_named() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let (log, truth) = simulate(folder, "in.mcap", &["--robots", "2", "--seed", "1"]);
    let (before, evaluation) = merge(folder, "in.mcap");
    assert_eq!(evaluation["right"], 1, "{evaluation}");

    // The first three are the ones that the methods lean on most.
    for tag in before.tags.iter().take(3) {
        let id = tag.tag_id.as_str();
        let place = place_in_map_2(&json(&truth), id);
        change_readings(&log, &folder.join("moved.mcap"), |robot, reading, position| {
            match robot == "robot2" && reading.tag_id == id {
                // A metre and a half aside.
                true => moved_reading(reading, position, place, place + Vector2::new(1.2, -0.9)),
                false => Some(reading),
            }
        });
        let (after, evaluation) = merge(folder, "moved.mcap");
        assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");
        assert!(after.accepted && after.reason.contains(id), "{id} is not in: {}", after.reason);
        assert!(after.tags.iter().all(|common| common.tag_id != id), "{id} is in use");
        assert!(before.tags.len() - after.tags.len() < 4, "{} and {} tags", before.tags.len(), after.tags.len());
    }
}

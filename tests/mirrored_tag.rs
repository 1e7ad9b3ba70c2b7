//! A tag that one robot sees in a wrong place, as a reflection or a move of the tag makes it, does not spoil a merge.

#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use gridweave_runtime::ros::{CommonTags, PoseStamped, RosMessage, TagRange, decode, encode};
use nalgebra::{Isometry2, Point2, Vector2};
use serde_json::Value;
use std::fs;
use std::path::Path;
use support::{LogBuilder, gridweave, simulate};
use tempfile::TempDir;

/// The reach of the tags' readers, metres.
const REACH: f64 = 3.0;

/// The places of a tag in the map of robot2: the true one, and one that is a metre and a half aside.
struct Places {
    truth: Point2<f64>,
    seen: Point2<f64>,
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Merges `log` in `folder`. Gives what the tag filter said last, and the measured outcome.
fn merge(folder: &Path, log: &str) -> (CommonTags, Value) {
    let args = ["merge", log, "-o", "out.mcap", "--results-only", "--summary", "summary.json"];
    gridweave(folder, &args).assert(0, &["merged 2 of 2"]);
    let evaluated = gridweave(folder, &["evaluate", "summary.json", "--truth", "in.truth.json", "--json"]);
    let output = fs::read(folder.join("out.mcap")).unwrap();
    let messages = mcap::MessageStream::new(&output).unwrap().map(Result::unwrap);
    let common = messages.filter(|message| schema_name(message) == CommonTags::NAME).last().unwrap();
    (decode(&common.data).unwrap(), serde_json::from_str(&evaluated.stdout).unwrap())
}

fn schema_name<'a>(message: &'a mcap::Message<'_>) -> &'a str {
    message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str())
}

/// Where the tag lies and is to be seen.
fn places(truth: &Value, tag: &str) -> Places {
    let number = |value: &Value| value.as_f64().unwrap();
    let frame = &truth["frames"]["robot2"];
    let transform_1_2 = Isometry2::new(Vector2::new(number(&frame["x"]), number(&frame["y"])), number(&frame["yaw"]));
    let place = &truth["tags"][tag];
    let truth = transform_1_2.inverse() * Point2::new(number(&place[0]), number(&place[1]));
    Places { truth, seen: truth + Vector2::new(1.2, -0.9) }
}

/// Writes `log` again, with the readings that robot2 would have if the tag were where it is to be seen.
fn move_tag(log: &Path, tag: &str, places: &Places, to: &Path) {
    let bytes = fs::read(log).unwrap();
    let mut moved = LogBuilder::new(to);
    let mut position = Point2::origin();
    let mut start = None;
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let seconds = (message.log_time - *start.get_or_insert(message.log_time)) as f64 * 1e-9;
        let (topic, name) = (message.channel.topic.as_str(), schema_name(&message));
        match topic {
            "/robot2/pose" => {
                let pose: PoseStamped = decode(&message.data).unwrap();
                position = Point2::from(pose.pose.planar().translation.vector);
            }
            "/robot2/tag_ranges" => {
                let mut reading: TagRange = decode(&message.data).unwrap();
                if reading.tag_id == tag {
                    // The reading keeps its noise.
                    reading.range += (position - places.seen).norm() - (position - places.truth).norm();
                    if (0.0..REACH).contains(&reading.range) {
                        moved.raw(seconds, topic, name, &encode(&reading).unwrap());
                    }
                    continue;
                }
            }
            _ => {}
        }
        moved.raw(seconds, topic, name, &message.data);
    }
    moved.finish();
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
        move_tag(&log, id, &places(&json(&truth), id), &folder.join("moved.mcap"));
        let (after, evaluation) = merge(folder, "moved.mcap");
        assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");
        assert!(after.accepted && after.reason.contains(id), "{id} is not in: {}", after.reason);
        assert!(after.tags.iter().all(|common| common.tag_id != id), "{id} is in use");
        assert!(before.tags.len() - after.tags.len() < 4, "{} and {} tags", before.tags.len(), after.tags.len());
    }
}

//! Two common tags merge two maps if the directions and the walls of the maps confirm them, and never wrongly.

use crate::support::{
    Ended, LogBuilder, change_readings, evaluate, gridweave, json, moved_reading, place_in_map_2, simulate,
};
use nalgebra::{Point2, Vector2};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The two tags that robots 1 and 2 both locate well.
const TWO: [&str; 2] = ["tag03", "tag04"];

/// A log of two robots in one building of which only two tags are left, in a separate folder.
struct World {
    folder: TempDir,
    log: PathBuf,
    truth: Value,
}

impl World {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let (all, truth) = simulate(folder.path(), "in.mcap", &["--robots", "2", "--seed", "20", "--set", "tags=9"]);
        let log = folder.path().join("two.mcap");
        change_readings(&all, &log, |_, reading, _| TWO.contains(&reading.tag_id.as_str()).then_some(reading));
        Self { truth: json(&truth), folder, log }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Merges a log of this folder. Returns how that ended, the decision on the pair, and the outcome.
    fn merge(&self, log: &Path, more: &[&str]) -> (Ended, Value, Value) {
        let args = [
            "run",
            "tag_merge",
            "--input",
            log.to_str().unwrap(),
            "--output",
            "out.mcap",
            "--results-only",
            "--summary",
            "summary.json",
        ];
        let ended = gridweave(self.path(), &[&args, more].concat());
        let alignment = json::<Value>(&self.path().join("summary.json"))["alignments"][0].clone();
        (ended, alignment, evaluate(self.path(), "in.truth.json".as_ref()))
    }

    /// The log as it would be if the tags of robot 2's map were elsewhere.
    fn with_tags_at(&self, elsewhere: impl Fn(usize, [Point2<f64>; 2]) -> Point2<f64>) -> PathBuf {
        let places = TWO.map(|tag| place_in_map_2(&self.truth, tag));
        let log = self.path().join("moved.mcap");
        change_readings(&self.log, &log, |robot, reading, position| {
            let tag = TWO.iter().position(|tag| *tag == reading.tag_id).unwrap();
            match robot {
                "robot2" => moved_reading(reading, position, places[tag], elsewhere(tag, places)),
                _ => Some(reading),
            }
        });
        log
    }
}

#[track_caller]
fn assert_refused(outcome: &(Ended, Value, Value), reason: &str) {
    let (ended, alignment, evaluation) = outcome;
    ended.assert(3, &["not merged: robot2"]);
    assert_eq!((&evaluation["wrong"], &evaluation["refused"]), (&Value::from(0), &Value::from(1)), "{evaluation}");
    let found = alignment["reason"].as_str().unwrap();
    assert!(found.contains(reason), "{found}");
}

#[test]
fn two_tags_merge_and_the_summary_says_what_the_merge_rests_on() {
    let world = World::new();
    let (ended, alignment, evaluation) = world.merge(&world.log, &[]);
    ended.assert(0, &["merged 2 of 2"]);
    assert_eq!(evaluation["right"], 1, "{evaluation}");
    assert_eq!(alignment["method"], "few tags+directions+icp");
    let reason = alignment["reason"].as_str().unwrap();
    for part in ["2 common tags only", "of the maps' directions", "the maps confirm it"] {
        assert!(reason.contains(part), "{reason}");
    }
}

#[test]
fn tags_that_are_turned_against_the_walls_are_refused() {
    let world = World::new();
    let log = world.with_tags_at(|tag, places| {
        let middle = nalgebra::center(&places[0], &places[1]);
        middle + nalgebra::Rotation2::new(0.3) * (places[tag] - middle)
    });
    assert_refused(&world.merge(&log, &[]), "the directions of both maps must confirm 2 common tags");
}

#[test]
fn tags_that_have_both_moved_alike_are_refused_by_the_walls() {
    let world = World::new();
    for shift in [Vector2::new(0.0, 1.0), Vector2::new(0.0, 2.0), Vector2::new(-0.7, 0.7), Vector2::new(-1.4, 1.4)] {
        let log = world.with_tags_at(|tag, places| places[tag] + shift);
        assert_refused(&world.merge(&log, &[]), "the maps do not confirm it");
    }
}

#[test]
fn robots_of_two_buildings_whose_tags_bear_the_same_ids_are_refused() {
    let world = World::new();
    let (other, _) = simulate(world.path(), "other.mcap", &["--robots", "2", "--seed", "21", "--set", "tags=9"]);
    let mut strangers = LogBuilder::new(&world.path().join("strangers.mcap"));
    for (log, robot) in [(&world.log, "/robot1/"), (&other, "/robot2/")] {
        let bytes = fs::read(log).unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
            if message.channel.topic.starts_with(robot) {
                let name = message.channel.schema.as_ref().unwrap().name.as_str();
                strangers.raw(message.log_time as f64 * 1e-9, &message.channel.topic, name, &message.data);
            }
        }
    }
    strangers.finish();
    let args = ["run", "tag_merge", "--input", "strangers.mcap", "--output", "out.mcap", "--results-only"];
    gridweave(world.path(), &args).assert(3, &["not merged: robot2"]);
}

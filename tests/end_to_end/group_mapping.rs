//! The pipeline `group_mapping` merges what it can, and says how surely.

use crate::support::{evaluate, json, published, published_pipeline, simulate};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn a_building_that_two_robots_have_seen_is_merged_by_directions_and_edges() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let world = ["--robots", "2", "--seed", "2", "--set", "overlap=0.9", "--set", "drift=0", "--set", "tags=0"];
    simulate(folder, "in.mcap", &world);
    let pipeline = published_pipeline("group_mapping");
    let run = ["run", &pipeline, "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
    published(folder, &run).assert(0, &["merged 2 of 2"]);
    let summary: Value = json(&folder.join("summary.json"));
    let alignment = &summary["alignments"][0];
    assert_eq!(alignment["method"], "radon+edges");
    let reason = alignment["reason"].as_str().unwrap();
    assert!(reason.contains("agree on the translation") && reason.contains("the directions of the walls"), "{reason}");
    assert!(summary["frames"]["robot2"]["covariance"][8].as_f64().unwrap() > 0.0, "{summary}");

    let evaluation = evaluate(folder, "in.truth.json".as_ref());
    assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");
}

#[test]
fn robots_of_which_one_has_seen_nothing_are_not_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    simulate(folder, "in.mcap", &["--robots", "2", "--seed", "2", "--set", "tags=0"]);
    let pipeline = published_pipeline("group_mapping");
    let run = ["run", &pipeline, "--input", "in.mcap", "--output", "out.mcap", "--set", "radon.min_similarity=1.0"];
    published(folder, &run)
        .assert(3, &["not merged: robot2", "of what they have in common at the best of four rotations"]);
}

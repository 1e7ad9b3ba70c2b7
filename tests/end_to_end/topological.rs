//! The pipeline `topological` merges topological maps of logs, and `topology_file_merge` those that were drawn by hand.

use crate::support::{evaluate, gridweave, json, simulate};
use serde_json::Value;
use std::fs;
use tempfile::TempDir;

#[test]
fn a_building_that_two_robots_have_seen_is_merged_by_its_ways() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let world = ["--robots", "2", "--seed", "4", "--set", "overlap=0.9", "--set", "drift=0", "--set", "tags=0"];
    simulate(folder, "in.mcap", &world);
    let run = ["run", "topological", "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
    gridweave(folder, &run).assert(0, &["merged 2 of 2"]);
    let summary: Value = json(&folder.join("summary.json"));
    let reason = summary["alignments"][0]["reason"].as_str().unwrap();
    assert!(reason.contains("paths coincide"), "{reason}");

    let evaluation = evaluate(folder, "in.truth.json".as_ref());
    assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");
}

#[test]
fn robots_whose_ways_have_too_little_in_common_are_not_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    simulate(folder, "in.mcap", &["--robots", "2", "--seed", "4", "--set", "overlap=0.9", "--set", "tags=0"]);
    let run = ["run", "topological", "--input", "in.mcap", "--output", "out.mcap", "--set", "matcher.min_paths=1000"];
    gridweave(folder, &run).assert(3, &["not merged: robot2"]);
}

/// A topological map as one draws it: nodes at these places, and a path for each pair of them.
fn drawn(nodes: &[[f64; 2]], paths: &[[usize; 2]]) -> String {
    let nodes: Vec<Value> = nodes.iter().map(|[x, y]| serde_json::json!({"x": x, "y": y})).collect();
    let paths: Vec<Value> = paths.iter().map(|[start, end]| serde_json::json!({"start": start, "end": end})).collect();
    serde_json::json!({"nodes": nodes, "paths": paths}).to_string()
}

#[test]
fn topological_maps_in_json_files_are_aligned() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let nodes = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [13.0, 0.0], [13.0, -2.5], [0.0, 3.0], [-5.0, 0.0]];
    let paths = [[0, 1], [1, 2], [1, 3], [3, 4], [0, 5], [0, 6]];
    // A quarter turn, and moved by (2, 1).
    let turned = nodes.map(|[x, y]| [2.0 - y, 1.0 + x]);
    fs::write(folder.join("a.json"), drawn(&nodes, &paths)).unwrap();
    fs::write(folder.join("b.json"), drawn(&turned, &paths)).unwrap();
    let run = ["run", "topology_file_merge", "--input", "a.json", "--input", "b.json", "--output", "out.mcap"];
    let run = [&run[..], &["--summary", "summary.json"]].concat();
    gridweave(folder, &run).assert(0, &["merged 2 of 2"]);
    let summary: Value = json(&folder.join("summary.json"));
    let frame = |key: &str| summary["frames"]["b"][key].as_f64().unwrap();
    // The inverse of the turn and the move.
    let (x, y, yaw) = (frame("x"), frame("y"), frame("yaw").to_degrees());
    assert!((x + 1.0).abs() < 0.01 && (y - 2.0).abs() < 0.01 && (yaw + 90.0).abs() < 0.1, "{summary}");
    gridweave(folder, &["merge", "a.json", "b.json", "-o", "merged.mcap"]).assert(0, &["merged 2 of 2"]);
}

#[test]
fn topological_maps_are_distinguished_from_other_inputs() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    fs::write(folder.join("a.json"), drawn(&[[0.0, 0.0]], &[])).unwrap();
    fs::write(folder.join("b.json"), "{").unwrap();
    let run = |pipeline: &str, inputs: &[&str]| {
        let inputs: Vec<&str> = inputs.iter().flat_map(|input| ["--input", input]).collect();
        gridweave(folder, &[&["run", pipeline, "--output", "out.mcap"][..], &inputs].concat())
    };
    run("topology_file_merge", &["a.json", "b.json"]).assert(1, &["b.json is not a topological map"]);
    run("topology_file_merge", &["a.json", "b.mcap"]).assert(2, &["a.json is a topological map, and b.mcap is not"]);
    run("auto_merge", &["a.json"]).assert(2, &["there is no stage of kind `topology_file_source`"]);
    run("topology_file_merge", &["a.mcap"]).assert(2, &["there is no stage of kind `mcap_source`"]);
    gridweave(folder, &["info", "a.json"]).assert(2, &["does not read topological maps"]);
}

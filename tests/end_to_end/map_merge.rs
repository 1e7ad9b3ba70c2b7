//! Maps are merged by the maps alone, rightly or not at all.

use crate::support::{Ended, evaluate, gridweave, gridweave_with, json, logs_in, real_logs, simulate};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Merges logs by their maps alone. Gives how that ended, and the summary.
fn merge(folder: &Path, logs: &[&Path], more: &[&str]) -> (Ended, Value) {
    let mut args = vec!["run", "map_merge", "--output", "out.mcap", "--summary", "summary.json"];
    args.extend(logs.iter().flat_map(|log| ["--input", log.to_str().unwrap()]));
    args.extend(more);
    let ended = gridweave(folder, &args);
    (ended, json(&folder.join("summary.json")))
}

/// A part of a log: the maps of one robot.
fn maps_of(robot: &str, folder: &Path, seed: &str) -> std::path::PathBuf {
    let (log, _) = simulate(folder, &format!("{seed}.mcap"), &["--robots", "2", "--seed", seed]);
    let part = folder.join(format!("{robot}-{seed}.mcap"));
    let topics = format!("out.only_topics=[\"/{robot}/map\"]");
    let args = ["run", "cut", "--input", log.to_str().unwrap(), "--output", part.to_str().unwrap(), "--set", &topics];
    gridweave(folder, &args).assert(0, &[]);
    part
}

#[test]
fn simulated_maps_are_merged_without_tags() {
    let folder = TempDir::new().unwrap();
    let args = ["--robots", "2", "--seed", "1001", "--set", "tags=0"];
    let (log, truth) = simulate(folder.path(), "in.mcap", &args);
    let (ended, summary) = merge(folder.path(), &[&log], &[]);
    ended.assert(0, &["merged 2 of 2"]);
    let evaluation = evaluate(folder.path(), &truth);
    assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");
    let alignment = &summary["alignments"][0];
    assert_eq!(alignment["method"], "maps+icp");
    let reason = alignment["reason"].as_str().unwrap();
    for part in ["the maps alone", "m of walls in common", "the maps confirm it"] {
        assert!(reason.contains(part), "{reason}");
    }
    let agreement = |name: &str| alignment["evidence"][name].as_f64().unwrap();
    assert!(agreement("wall_on_wall_m") > 10.0 * agreement("wall_on_free_m"), "{alignment}");
    assert!(agreement("overlap_m2") > 20.0 && agreement("hypotheses") >= 1.0, "{alignment}");
}

#[test]
fn maps_of_two_buildings_are_not_merged() {
    let folder = TempDir::new().unwrap();
    for (seed_a, seed_b) in [("1001", "1002"), ("1012", "1013")] {
        let (a, b) = (maps_of("robot1", folder.path(), seed_a), maps_of("robot2", folder.path(), seed_b));
        let (ended, summary) = merge(folder.path(), &[&a, &b], &[]);
        ended.assert(3, &["not merged: robot2"]);
        let reason = summary["unmerged"]["robot2"].as_str().unwrap();
        assert!(!reason.is_empty());
    }
}

#[test]
fn the_output_is_the_same_on_every_engine_and_any_number_of_cores() {
    let folder = TempDir::new().unwrap();
    let args = ["--robots", "2", "--seed", "1003", "--set", "snapshots=1"];
    let (log, _) = simulate(folder.path(), "in.mcap", &args);
    let mut first: Option<Vec<u8>> = None;
    for (engine, threads) in [("single", "1"), ("threads", "2"), ("processes", "4")] {
        let args = ["run", "map_merge", "--input", log.to_str().unwrap(), "--output", "out.mcap", "--engine", engine];
        gridweave_with(folder.path(), &args, &[("RAYON_NUM_THREADS", threads)]).assert(0, &[]);
        let bytes = fs::read(folder.path().join("out.mcap")).unwrap();
        assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{engine} with {threads} threads differs");
    }
}

#[test]
#[ignore = "needs GRIDWEAVE_LOGS: the folder of real logs"]
fn every_pair_of_the_real_logs_is_right_and_no_other_is_merged() {
    let folder = TempDir::new().unwrap();
    for log in logs_in(&real_logs()) {
        let name = log.file_stem().unwrap().to_str().unwrap();
        let (ended, summary) = merge(folder.path(), &[&log], &["--results-only"]);
        let truth = log.with_extension("truth.json");
        if !truth.exists() {
            ended.assert(3, &["not merged"]);
            println!("{name}: not merged: {}", summary["unmerged"]["robot2"]);
            assert_eq!(summary["frames"].as_object().unwrap().len(), 1);
            continue;
        }
        assert_eq!(ended.status, 0, "{name}: {ended:#?}");
        let evaluation = evaluate(folder.path(), &truth);
        println!("{name}: {evaluation}");
        assert_eq!((&evaluation["wrong"], &evaluation["refused"]), (&Value::from(0), &Value::from(0)), "{name}");
    }
}

#[test]
fn without_enough_tags_a_merge_goes_by_the_maps() {
    let folder = TempDir::new().unwrap();
    for tags in ["0", "36"] {
        let args = ["--robots", "2", "--seed", "1001", "--set", &format!("tags={tags}")];
        let (log, truth) = simulate(folder.path(), "in.mcap", &args);
        let args = ["merge", log.to_str().unwrap(), "-o", "out.mcap", "--summary", "summary.json", "--results-only"];
        gridweave(folder.path(), &args).assert(0, &["merged 2 of 2"]);
        let summary: Value = json(&folder.path().join("summary.json"));
        let alignment = &summary["alignments"][0];
        let method = if tags == "0" { "maps+icp" } else { "tags+directions+icp" };
        assert_eq!(alignment["method"], method, "{alignment}");
        assert_eq!(
            alignment["reason"].as_str().unwrap().contains("found by the maps, too"),
            tags != "0",
            "{alignment}"
        );
        assert_eq!(evaluate(folder.path(), &truth)["right"], 1);
    }
}

#[test]
fn robots_in_a_building_whose_parts_are_alike_are_not_merged_wrongly() {
    let folder = TempDir::new().unwrap();
    // In the second, two robots have seen opposite ends, and only the self-similarity of each map shows the ambiguity.
    let (ambiguous, alike, chance) = ("decide which is right", "the building is self-similar", "may be chance");
    for (layout, seed, reason) in
        [("symmetric", "903", ambiguous), ("symmetric", "904", alike), ("repeated", "901", chance)]
    {
        let layout = format!("layout=\"{layout}\"");
        let mut args = vec!["--robots", "3", "--seed", seed];
        for setting in ["tags=0", "snapshots=1", "overlap=0.6", "clutter=0.02", &layout] {
            args.extend(["--set", setting]);
        }
        let (log, truth) = simulate(folder.path(), "in.mcap", &args);
        let (ended, summary) = merge(folder.path(), &[&log], &[]);
        ended.assert(3, &["not merged: robot2", reason]);
        assert_eq!(evaluate(folder.path(), &truth)["wrong"], 0, "{summary}");
    }
}

#[test]
fn one_tag_decides_between_two_places_that_look_the_same() {
    let folder = TempDir::new().unwrap();
    let mut args = vec!["--robots", "2", "--seed", "905"];
    for setting in ["tags=1", "snapshots=1", "overlap=1.0", "clutter=0.0", "layout=\"symmetric\""] {
        args.extend(["--set", setting]);
    }
    let (log, truth) = simulate(folder.path(), "in.mcap", &args);
    let (ended, _) = merge(folder.path(), &[&log], &[]);
    ended.assert(3, &["not merged: robot2"]);
    let args = ["merge", log.to_str().unwrap(), "-o", "out.mcap", "--summary", "summary.json", "--explain", "robot2"];
    gridweave(folder.path(), &args).assert(0, &["found by the ", ", too"]);
    assert_eq!(evaluate(folder.path(), &truth)["right"], 1);
}

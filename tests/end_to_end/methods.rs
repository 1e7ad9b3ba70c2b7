//! The paper's methods 1, 2 and 3, as the pipelines that ship: each merges, and each is as exact as it can be.

use crate::support::{SMALL_BUILDING, evaluate, gridweave, json, published, simulate, start_program};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The world of these tests.
const SEED: [&str; 2] = ["--seed", "2"];

/// How far robot2 is from the truth: metres at the middle of its map, and degrees.
struct Errors {
    metres: f64,
    degrees: f64,
}

/// Merges the log of `folder` by a shipped pipeline. Gives the errors and the summary.
fn merge(folder: &Path, pipeline: &str) -> (Errors, Value) {
    let run = ["run", pipeline, "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
    gridweave(folder, &run).assert(0, &["merged 2 of 2"]);
    let evaluation = evaluate(folder, "in.truth.json".as_ref());
    assert_eq!(evaluation["right"], 1, "{pipeline}: {evaluation}");
    let robot = &evaluation["robots"][0];
    let errors = Errors { metres: robot["error_m"].as_f64().unwrap(), degrees: robot["error_deg"].as_f64().unwrap() };
    (errors, json(&folder.join("summary.json")))
}

#[test]
fn the_three_methods_merge_and_each_uses_what_the_paper_says() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    simulate(folder, "in.mcap", &[&SMALL_BUILDING[..], &SEED].concat());
    let (tags, summary) = merge(folder, "tag_only");
    assert_eq!(summary["alignments"][0]["method"], "tags");
    assert!(summary["stages"].get("lines").is_none(), "no wall takes part: {summary}");
    let (directions, summary) = merge(folder, "tag_direction");
    assert_eq!(summary["alignments"][0]["method"], "tags+directions");
    assert!(summary["stages"].get("icp").is_none(), "{summary}");
    let (icp, summary) = merge(folder, "tag_merge");
    assert_eq!(summary["alignments"][0]["method"], "tags+directions+icp");

    // Tags are located to some centimetres, walls to a fraction of a cell.
    assert!(tags.metres < 0.1 && directions.metres < 0.1, "{} {}", tags.metres, directions.metres);
    assert!(icp.metres < 0.01 && icp.degrees < 0.1, "{} {}", icp.metres, icp.degrees);
    assert!(icp.metres < tags.metres.min(directions.metres), "{} {}", tags.metres, directions.metres);
    assert!(directions.degrees < tags.degrees, "{} {}", directions.degrees, tags.degrees);
}

#[test]
fn without_walls_to_compare_robots_without_common_tags_are_still_refused() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let few_tags = SMALL_BUILDING.map(|word| if word == "tags=24" { "tags=2" } else { word });
    simulate(folder, "in.mcap", &[&few_tags[..], &SEED].concat());
    for pipeline in ["tag_only", "tag_direction"] {
        let run = ["run", pipeline, "--input", "in.mcap", "--output", "out.mcap"];
        gridweave(folder, &run).assert(3, &["not merged: robot2", "in common"]);
    }
}

#[test]
fn the_experiment_writes_its_tables_and_plots() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let logs = folder.join("logs");
    fs::create_dir(&logs).unwrap();
    simulate(&logs, "in.mcap", &[&SMALL_BUILDING[..], &SEED].concat());
    fs::copy(logs.join("in.mcap"), logs.join("no_truth.mcap")).unwrap();
    let args = ["methods", "--seeds", "1", "--repetitions", "1", "--logs", "logs", "--out", "results"];
    let ended = start_program(Path::new(env!("CARGO_BIN_EXE_experiments")), folder, &args, &[]).wait();
    ended.assert(0, &["7178.27", "123.45", "18497.6", "2 recorded logs"]);
    let read = |name: &str| fs::read_to_string(folder.join("results").join(name)).unwrap();
    let runs = read("methods_runs.csv");
    let cells: Vec<Vec<&str>> = runs.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| cells[0].iter().position(|head| *head == name).unwrap();
    let [world, method, outcome, square, apart] =
        ["world", "method", "outcome", "mse px2", "alignment apart m"].map(column);
    for number in ["1", "2", "3"] {
        let of = |name: &str| cells.iter().find(|row| row[world] == name && row[method] == number).unwrap();
        assert_eq!(of("in")[outcome], "right");
        let [square, apart] = [square, apart].map(|column| of("in")[column].parse::<f64>().unwrap());
        assert!(square > 0.0 && square < 10.0, "method {number}: {square} px2");
        assert!(apart < 0.01, "method {number}: what is timed is {apart} m off what the run does");
        // Without a truth the robots are taken as unrelated, and a merge as wrong.
        assert_eq!(of("no_truth")[outcome], "wrong");
    }
    for plot in ["methods_exact.svg", "methods_drift.svg", "methods_logs.svg"] {
        assert!(read(plot).ends_with("</svg>\n"));
    }
}

/// Published methods that propose, and the verifier that judges what they propose.
const VERIFIED: &str = r#"
[pipeline]
name = "verified"

[robots]
map = "/{robot}/map"

[stages.log]
kind = "mcap_source"

[stages.cleaner]
kind = "map_cleaner"
inputs = ["log.map"]

[stages.radon]
kind = "radon_aligner"
inputs = ["cleaner"]

[stages.topology]
kind = "topology_extractor"
inputs = ["cleaner"]

[stages.matcher]
kind = "topology_matcher"
inputs = ["topology"]

[stages.icp]
kind = "icp_refiner"
inputs = ["cleaner", "radon", "matcher.hypotheses"]

[stages.verifier]
kind = "merge_verifier"
inputs = ["cleaner", "icp.alignment"]

[stages.frames]
kind = "frame_solver"
inputs = ["log.map", "verifier"]

[stages.output]
kind = "mcap_sink"
inputs = ["radon", "matcher.alignment", "topology", "icp.*", "verifier.*", "frames.*"]
"#;

#[test]
fn what_published_methods_propose_is_merged_only_where_the_verifier_finds_it_alone() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    fs::write(folder.join("verified.toml"), VERIFIED).unwrap();
    for seed in ["2", "3", "4"] {
        simulate(folder, "in.mcap", &[&SMALL_BUILDING[..], &["--seed", seed]].concat());
        let run = ["run", "verified.toml", "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
        let status = published(folder, &run).status;
        assert!(matches!(status, 0 | 3), "seed {seed}: {status}");
        let evaluation = evaluate(folder, "in.truth.json".as_ref());
        assert_eq!(evaluation["wrong"], 0, "seed {seed}: {evaluation}");
        let method = json::<Value>(&folder.join("summary.json"))["alignments"][0]["method"].to_string();
        assert!(method.contains("radon") || method.contains("topology"), "seed {seed}: {method}");
    }
}

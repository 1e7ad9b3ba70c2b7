//! Pipelines are compared on the same logs, and whatever becomes of a run is a result.

use crate::support::{Ended, SMALL_BUILDING, gridweave, published, published_pipeline, simulate};
use gridweave_logs::map_file::{self, GridMap};
use gridweave_runtime::ros::MapMetaData;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder with logs of two worlds and their truths.
fn worlds() -> TempDir {
    let folder = TempDir::new().unwrap();
    let logs = folder.path().join("logs");
    fs::create_dir(&logs).unwrap();
    for (name, seed) in [("one.mcap", "2"), ("two.mcap", "5")] {
        simulate(&logs, name, &[&SMALL_BUILDING[..], &["--seed", seed]].concat());
    }
    folder
}

fn compare(folder: &Path, args: &[&str]) -> Ended {
    gridweave(folder, &[&["compare"], args].concat())
}

/// What `--json` has printed.
fn compared(folder: &Path, args: &[&str]) -> Value {
    json_of(&compare(folder, &[args, &["--json"]].concat()))
}

/// The JSON that a command has printed.
fn json_of(ended: &Ended) -> Value {
    ended.assert(0, &[]);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Pipeline and log of each entry.
fn named(entries: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or("all").to_owned();
    entries.as_array().unwrap().iter().map(|entry| (text(&entry["pipeline"]), text(&entry["log"]))).collect()
}

#[test]
fn every_pipeline_is_run_on_every_log_and_reported_in_the_given_order() {
    let folder = worlds();
    let args = [
        "--pipelines",
        "tag_only",
        "topological",
        "--inputs",
        "logs",
        "--seeds",
        "2",
        "--jobs",
        "3",
        "--csv",
        "table.csv",
    ];
    let output = compared(folder.path(), &args);
    let expected =
        ["tag_only", "topological"].map(|pipeline| ["one", "two", "all"].map(|log| (pipeline.into(), log.into())));
    assert_eq!(named(&output["rows"]), expected.concat());
    let runs = output["runs"].as_array().unwrap();
    let seeds: Vec<u64> = runs.iter().map(|run| run["seed"].as_u64().unwrap()).collect();
    assert_eq!(seeds, [1, 2].repeat(4));
    for run in runs {
        assert_eq!(run["failure"], Value::Null, "{run}");
        assert!(run["time_s"].as_f64().unwrap() > 0.0 && run["cpu_s"].as_f64().unwrap() > 0.0, "{run}");
        assert!(run["memory_bytes"].as_u64().unwrap() > 1_000_000, "{run}");
    }
    let tag_only = &output["rows"][2];
    assert_eq!(
        (&tag_only["runs"], &tag_only["robots"], &tag_only["success"]),
        (&json!(4), &json!(4), &json!(4)),
        "{tag_only}"
    );
    assert!(tag_only["median_m"].as_f64().unwrap() < 0.5 && tag_only["p90_deg"].as_f64().unwrap() < 1.0);

    let csv = fs::read_to_string(folder.path().join("table.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 7);
    assert!(lines[0].starts_with("pipeline,log,runs,failed,robots,success,wrong,refused,median_m"), "{csv}");
    assert!(lines[3].starts_with("tag_only,all,4,0,4,4,0,0,0."), "{csv}");
    let output = compare(folder.path(), &["--pipelines", "tag_only", "--inputs", "logs/one.mcap", "--markdown"]);
    output.assert(0, &["| tag_only | one | 1 of 1 | 0 | 0 | 0 |"]);
}

#[test]
fn a_run_that_fails_does_not_end_the_others_and_is_reported() {
    let folder = worlds();
    let (broken, truth) = (folder.path().join("logs/broken.mcap"), folder.path().join("logs/broken.truth.json"));
    fs::write(broken, b"this is not a log, for sure").unwrap();
    fs::copy(folder.path().join("logs/one.truth.json"), truth).unwrap();
    // More jobs than runs, than threads that a system has, and than addresses.
    let ended = compare(folder.path(), &["--pipelines", "tag_only", "--inputs", "logs", "--jobs", "1000000000000"]);
    ended.assert(1, &["failed: tag_only on broken, seed 1: error", "1 of 1"]);
    let lines: Vec<&str> = ended.stdout.lines().map(str::trim).filter(|line| line.starts_with("tag_only")).collect();
    assert_eq!(lines.len(), 4, "{ended:#?}");
}

#[test]
fn a_killed_run_is_reported_with_its_time_and_memory() {
    let folder = worlds();
    let pipeline = r#"
        [stages.log]
        kind = "mcap_source"
        [stages.source]
        kind = "troubled_source"
        count = 10
        [stages.trouble]
        kind = "troubled_stage"
        inputs = ["source"]
        at = 3
        what = "abort"
        [stages.output]
        kind = "mcap_sink"
        inputs = ["log.map", "trouble"]
    "#;
    fs::write(folder.path().join("aborts.toml"), pipeline).unwrap();
    let ended =
        compare(folder.path(), &["--pipelines", "aborts.toml", "tag_only", "--inputs", "logs/one.mcap", "--json"]);
    ended.assert(1, &[]);
    let output: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(output["runs"][0]["failure"], "it was ended by signal 6", "{output}");
    assert!(output["runs"][0]["memory_bytes"].as_u64().unwrap() > 1_000_000, "{output}");
    assert_eq!((&output["rows"][0]["failed"], &output["rows"][1]["success"]), (&json!(1), &json!(1)));
}

/// A room with a corner cut off, moved by 1 m in the second map.
fn save_rooms(folder: &Path) {
    for (name, x) in [("day1", 0.0), ("day2", 1.0)] {
        let (width, height) = (120_u32, 90_u32);
        let value = |index: u32| {
            let (i, j) = (index % width, index / width);
            let is_wall =
                i < 2 || j < 2 || i + 2 >= width || j + 2 >= height || (i == 70 && j > 30) || (j == 50 && i < 40);
            if is_wall { 100 } else { 0 }
        };
        let mut info = MapMetaData { resolution: 0.05, width, height, ..Default::default() };
        info.origin.position.x = x;
        let map = GridMap { info, cells: (0..width * height).map(value).collect() };
        map_file::save(&folder.join(format!("{name}.yaml")), &map).unwrap();
    }
}

#[test]
fn pairs_of_map_files_are_measured_at_the_places_that_they_have_in_common() {
    let folder = TempDir::new().unwrap();
    save_rooms(folder.path());
    let common: Vec<[f64; 4]> = (0..6).map(f64::from).map(|i| [1.0 + i, 1.0, i, 1.0]).collect();
    let pair = |name: &str, common: &Value| json!({"pair": name, "a": "day1", "b": "day2", "common": common});
    let pairs = json!([pair("rooms", &json!(common)), pair("nothing", &json!([]))]);
    fs::write(folder.path().join("pairs.json"), pairs.to_string()).unwrap();
    let pipeline = published_pipeline("hough_spectrum");
    let args = ["compare", "--pipelines", &pipeline, "--inputs", ".", "--json"];
    let output = json_of(&published(folder.path(), &args));
    assert_eq!(
        named(&output["rows"]),
        ["rooms", "nothing", "all"].map(|log| ("hough_spectrum".to_owned(), log.to_owned()))
    );
    let robot = &output["runs"][0]["robots"][0];
    assert_eq!((&robot["robot"], &robot["outcome"]), (&json!("day2"), &json!("right")), "{output}");
    assert!(robot["error_m"].as_f64().unwrap() < 0.1 && robot["error_deg"].as_f64().unwrap() < 0.5, "{robot}");
    assert_eq!(output["runs"][1]["robots"][0]["outcome"], "wrong", "they are merged, and have nothing in common");
    let brief = json_of(&published(folder.path(), &[&args[..], &["--by", "input"]].concat()));
    assert_eq!(named(&brief["rows"]), [("hough_spectrum".to_owned(), ".".to_owned())]);
}

#[test]
fn inputs_that_cannot_be_compared_are_errors_before_anything_runs() {
    let folder = worlds();
    fs::copy(folder.path().join("logs/one.mcap"), folder.path().join("lone.mcap")).unwrap();
    fs::copy(folder.path().join("logs/one.mcap"), folder.path().join("odd.mcap")).unwrap();
    fs::write(folder.path().join("odd.truth.json"), r#"{"frames": 3}"#).unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    for (args, status, words) in [
        (vec!["--pipelines", "tag_only", "--inputs", "lone.mcap"], 1, ["lone.truth.json", "--unrelated"]),
        (vec!["--pipelines", "tag_only", "--inputs", "odd.mcap"], 1, ["odd.truth.json", "is not a truth file"]),
        (vec!["--pipelines", "tag_only", "--inputs", "empty"], 2, ["empty", "pairs.json"]),
        (vec!["--pipelines", "tag_only", "--inputs", "nowhere"], 2, ["there is no", "nowhere"]),
        (vec!["--pipelines", "tag_only", "--inputs", "logs", "logs"], 2, ["logs", "twice"]),
        (vec!["--pipelines", "tag_only", "tag_only", "--inputs", "logs"], 2, ["tag_only", "twice"]),
        (vec!["--pipelines", "nothing", "--inputs", "logs"], 2, ["`nothing`", "there is no file"]),
        (vec!["--pipelines", "live", "--inputs", "logs"], 2, ["live", ""]),
        (vec!["--pipelines", "map_file_merge", "--inputs", "logs"], 2, ["mcap_source", ""]),
        (vec!["--pipelines", "tag_only", "--inputs", "logs", "--seeds", "0"], 2, ["--seeds", "0"]),
        (vec!["--pipelines", "tag_only"], 2, ["--inputs", "required"]),
    ] {
        let ended = compare(folder.path(), &args);
        ended.assert(status, &words);
        assert!(ended.stdout.is_empty(), "{ended:#?}");
    }
    let output = compared(folder.path(), &["--pipelines", "tag_only", "--inputs", "lone.mcap", "--unrelated"]);
    assert_eq!(output["runs"][0]["robots"][0]["outcome"], "wrong", "{output}");
}

#[test]
fn a_table_that_would_replace_an_input_or_a_pipeline_is_refused() {
    let folder = worlds();
    fs::write(folder.path().join("p.toml"), gridweave(folder.path(), &["pipelines", "tag_only"]).stdout).unwrap();
    for output in ["logs/one.mcap", "logs/one.truth.json", "logs/../logs/two.truth.json", "p.toml"] {
        let before = fs::read(folder.path().join(output)).unwrap();
        let ended = compare(folder.path(), &["--pipelines", "p.toml", "--inputs", "logs", "--csv", output]);
        ended.assert(2, &["is an input"]);
        assert!(fs::read(folder.path().join(output)).unwrap() == before, "{output}");
    }
    let trace = ["--pipelines", "p.toml", "--inputs", "logs", "--trace", "logs/one.truth.json"];
    compare(folder.path(), &trace).assert(2, &["is an input"]);
}

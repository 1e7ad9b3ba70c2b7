//! Suggestions, log lines, traces, completions and manual pages of the command.

use crate::support::{SMALL_BUILDING, gridweave, gridweave_program, simulate};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use tempfile::TempDir;

const STAGES: [&str; 3] = ["log", "fuser", "output"];

#[test]
fn a_name_that_is_mistyped_gets_a_suggestion() {
    let folder = TempDir::new().unwrap();
    gridweave(folder.path(), &["run", "tag_mrege", "--input", "x"]).assert(2, &["did you mean `tag_merge`?"]);
    gridweave(folder.path(), &["pipelines", "tag_mrege"]).assert(2, &["did you mean `tag_merge`?"]);
    gridweave(folder.path(), &["kinds", "line_extracter"]).assert(2, &["did you mean `line_extractor`?"]);
    gridweave(folder.path(), &["run", "./tag_mrege"]).assert(2, &["cannot read the pipeline"]);
}

#[test]
fn every_shipped_pipeline_is_listed_and_its_file_passes_the_check() {
    let folder = TempDir::new().unwrap();
    let list = gridweave(folder.path(), &["pipelines"]);
    list.assert(0, &["auto_merge", "map-only merge"]);
    let names: Vec<&str> = list.stdout.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    for name in &names {
        let file = format!("{name}.toml");
        fs::write(folder.path().join(&file), gridweave(folder.path(), &["pipelines", name]).stdout).unwrap();
        gridweave(folder.path(), &["check", &file]).assert(0, &[]);
    }
    assert!(names.len() > 10, "{names:?}");
}

#[test]
fn the_work_of_the_stages_is_logged_on_demand_on_any_engine() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    for engine in ["single", "processes"] {
        let merge = ["run", "map_merge", "--input", "in.mcap", "--output", "out.mcap", "--engine", engine];
        let logged = gridweave(folder.path(), &[&merge[..], &["-v"]].concat());
        for stage in STAGES {
            assert!(logged.stderr.contains(&format!("stage {stage} (")), "{}", logged.stderr);
            assert!(logged.stderr.contains(&format!("stage {stage} ends: ")), "{}", logged.stderr);
        }
        let silent = gridweave(folder.path(), &merge);
        assert!(!silent.stderr.contains("stage fuser"), "{}", silent.stderr);
    }
    for engine in ["threads", "processes"] {
        let merge = ["run", "map_merge", "--input", "in.mcap", "--output", "out.mcap", "--engine", engine];
        let logged = gridweave(folder.path(), &[&merge[..], &["-vv", "--log-format", "json"]].concat());
        let lines: Vec<Value> = logged.stderr.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let receives = |line: &&Value| line["level"] == "DEBUG" && line["span"]["stage"] == "fuser";
        assert!(lines.iter().any(|line| receives(&line)), "{}", logged.stderr);
    }
}

#[test]
fn a_trace_has_a_span_for_each_stage_and_message() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    let merge = ["run", "map_merge", "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
    gridweave(folder.path(), &[&merge[..], &["--trace", "trace.json"]].concat()).assert(0, &[]);
    let read = |name: &str| -> Value { serde_json::from_slice(&fs::read(folder.path().join(name)).unwrap()).unwrap() };
    let (trace, summary) = (read("trace.json"), read("summary.json"));
    let begins: Vec<&Value> = trace.as_array().unwrap().iter().filter(|event| event["ph"] == "B").collect();
    let stages: BTreeSet<&str> = begins.iter().filter_map(|event| event["name"].as_str()).collect();
    assert!(STAGES.iter().all(|stage| stages.contains(stage)), "{stages:?}");
    let received = begins.iter().filter(|event| event["name"] == "fuser" && event["args"]["from"].is_string()).count();
    assert_eq!(Some(received as u64), summary["stages"]["fuser"]["messages_in"].as_u64());
}

#[test]
fn a_trace_replaces_no_other_file_of_the_command_and_none_if_the_command_fails() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let merge = ["merge", "in.mcap", "-o", "out.mcap", "--summary", "s.json"];
    gridweave(folder.path(), &merge).assert(0, &[]);
    let before = ["in.mcap", "in.truth.json", "s.json"].map(read);
    fs::write(folder.path().join("old.json"), "old").unwrap();
    for (args, trace, reasons) in [
        (&merge[..], "in.mcap", &["must end in .json"][..]),
        (&merge, "s.json", &["s.json", "--trace"]),
        (&["evaluate", "s.json", "--truth", "in.truth.json"], "in.truth.json", &["in.truth.json", "--trace"]),
        (&["evaluate", "s.json", "--truth=in.truth.json"], "./in.truth.json", &["in.truth.json", "--trace"]),
        (&["simulate", "-o", "in.mcap"], "in.truth.json", &["would be written twice"]),
        (&[&merge[..], &["--engine", "processes"]].concat(), "old.json", &["the engine `processes` has none"]),
    ] {
        gridweave(folder.path(), &[args, &["--trace", trace]].concat()).assert(2, reasons);
    }
    gridweave(folder.path(), &["merge", "none.mcap", "-o", "o.mcap", "--trace", "old.json"]).assert(1, &["none.mcap"]);
    assert_eq!(read("old.json"), b"old");
    assert!(["in.mcap", "in.truth.json", "s.json"].map(read) == before);
    assert!(fs::read_dir(folder.path()).unwrap().all(|file| file.unwrap().path().extension() != Some("part".as_ref())));
    gridweave(folder.path(), &[&merge[..], &["--trace", "old.json"]].concat()).assert(0, &[]);
    assert!(serde_json::from_slice::<Value>(&read("old.json")).is_ok());
}

#[test]
fn completions_and_manual_pages_cover_every_command() {
    let folder = TempDir::new().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        gridweave(folder.path(), &["shell", "completions", shell]).assert(0, &["merge", "--summary"]);
    }
    gridweave(folder.path(), &["shell", "man", "man1"]).assert(0, &[]);
    // They are of the program that writes them.
    let program = gridweave_program().file_name().unwrap().to_string_lossy();
    let page = fs::read_to_string(folder.path().join(format!("man1/{program}-merge.1"))).unwrap();
    assert!(page.contains("map_server"), "{page}");
}

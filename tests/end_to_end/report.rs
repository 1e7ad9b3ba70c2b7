//! The page that a report is.

use crate::support::{MARKUP, gridweave, merged_folder};
use serde_json::Value;
use std::fs;
use tempfile::TempDir;

fn page(folder: &TempDir) -> String {
    fs::read_to_string(folder.path().join("report.html")).unwrap()
}

/// The data for the script of a page.
fn data(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn a_report_holds_what_the_log_does_moment_by_moment() {
    let folder = merged_folder();
    let args = ["report", "merged.mcap", "-o", "report.html"];
    gridweave(folder.path(), &args).assert(0, &["wrote report.html", "open it in a browser"]);
    let page = page(&folder);
    let data = data(&page);
    assert_eq!(data["times"], serde_json::json!([0.0, 5.0, 10.0]));
    let names: Vec<&str> =
        data["robots"].as_array().unwrap().iter().map(|robot| robot["name"].as_str().unwrap()).collect();
    assert_eq!(names, [MARKUP, "robot1", "robot2"]);
    let robot = &data["robots"][2];
    // Beside the others first, and then as it was merged.
    assert_eq!(robot["map"].as_array().unwrap().len(), 2, "{robot}");
    let found = &robot["findings"].as_array().unwrap().last().unwrap()["what"];
    let counts =
        ["segments", "tags", "path", "bends", "places", "ways"].map(|part| found[part].as_array().unwrap().len());
    assert_eq!(counts, [1, 1, 2, 4, 2, 1]);
    assert_eq!(data["merged"].as_array().unwrap().len(), 2, "none, and one that stays");
    let walls = |version: usize| robot["findings"][version]["what"]["segments"].as_array().unwrap().len();
    assert_eq!((walls(0), robot["findings"][0]["from"].as_u64()), (0, Some(0)));
    let first = &data["robots"][1]["findings"];
    let found = &first.as_array().unwrap().last().unwrap()["what"];
    assert_eq!(found["segments"].as_array().unwrap().len(), 1, "the first message after a moment is not lost: {first}");
    assert_eq!(data["hypotheses"].as_array().unwrap().len(), 2);
    assert_eq!(data["frames"].as_array().unwrap().len(), 2);
    assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert"));

    gridweave(folder.path(), &args).assert(0, &[]);
    assert!(page == self::page(&folder), "the same every time");
}

#[test]
fn the_summary_of_the_run_adds_what_stages_did() {
    let folder = merged_folder();
    let stage = r#"{"messages_in": 7, "messages_out": 3, "busy_ms": 12.5, "warnings": {"a map was left out": 2}}"#;
    fs::write(folder.path().join("summary.json"), format!(r#"{{"stages": {{"icp": {stage}}}}}"#)).unwrap();
    let args = ["report", "merged.mcap", "-o", "report.html", "--summary", "summary.json"];
    gridweave(folder.path(), &args).assert(0, &[]);
    let page = page(&folder);
    assert!(page.contains("<th>icp</th>") && page.contains("12.5") && page.contains("a map was left out"));
}

#[test]
fn inputs_that_cannot_be_reported_are_errors() {
    let folder = merged_folder();
    let refused = |args: &[&str], status: i32, words: &str| {
        gridweave(folder.path(), &[&["report", "-o", "report.html"], args].concat()).assert(status, &[words]);
        assert!(!folder.path().join("report.html").exists());
    };
    refused(&["missing.mcap"], 1, "missing.mcap");
    refused(&["a.yaml"], 2, "`report` reads logs");
    let log = std::fs::read(folder.path().join("merged.mcap")).unwrap();
    gridweave(folder.path(), &["report", "merged.mcap", "-o", "./merged.mcap"]).assert(2, &["would be overwritten"]);
    assert!(std::fs::read(folder.path().join("merged.mcap")).unwrap() == log);
    refused(&["merged.mcap", "--summary", "/dev/zero"], 1, "no regular file");
    fs::write(folder.path().join("wrong.json"), "{}").unwrap();
    refused(&["merged.mcap", "--summary", "wrong.json"], 1, "wrong.json is not a summary");
    refused(&["merged.mcap", "--topics", "/icp/alignment"], 1, "there is nothing to report");
}

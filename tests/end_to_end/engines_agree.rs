//! The same log, pipeline and seed give the same output, byte for byte, on every engine and any number of cores.

use crate::support::{Ended, gridweave_with, json, simulate};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// Every way to run that must not matter.
const WAYS: [(&str, &str); 7] = [
    ("single", "1"),
    ("single", "4"),
    ("threads", "1"),
    ("threads", "2"),
    ("threads", "4"),
    ("threads-ipc", "2"),
    ("processes", "2"),
];

/// Those of them that differ the most, for logs that take long.
pub(crate) const FAR_APART: [(&str, &str); 3] = [("single", "1"), ("threads", "4"), ("processes", "2")];

/// Merges `log` in these ways, and fails the test where the outputs or the summaries differ. How the last of them
/// ended, and its summary as `summary.json` in the folder.
pub(crate) fn assert_same_output(folder: &Path, log: &Path, ways: &[(&str, &str)]) -> (Ended, Value) {
    let mut first: Option<(Vec<u8>, Value, String)> = None;
    let mut last = None;
    for (engine, threads) in ways {
        let output = folder.join("out.mcap");
        let args = ["merge", log.to_str().unwrap(), "-o", output.to_str().unwrap(), "--engine", *engine];
        let args = [&args[..], &["--summary", "summary.json", "--map", "merged.yaml"]].concat();
        let ended = gridweave_with(folder, &args, &[("RAYON_NUM_THREADS", *threads)]);
        assert!(ended.status == 0 || ended.status == 3, "{ended:#?}");
        let bytes = std::fs::read(&output).unwrap();
        let summary = summary_without_times(folder);
        let (expected, expected_summary, way) =
            first.get_or_insert_with(|| (bytes.clone(), summary.clone(), format!("{engine} {threads}")));
        let differs = expected.iter().zip(&bytes).position(|(a, b)| a != b);
        assert!(
            *expected == bytes,
            "{}: {way} and {engine} {threads} differ at byte {differs:?}; lengths {} and {}",
            log.display(),
            expected.len(),
            bytes.len()
        );
        assert_eq!(*expected_summary, summary, "{way} and {engine} {threads}");
        last = Some(ended);
    }
    let summary = std::fs::read(folder.join("summary.json")).unwrap();
    (last.unwrap(), serde_json::from_slice(&summary).unwrap())
}

/// The summary, in which only the times of the stages may differ.
fn summary_without_times(folder: &Path) -> Value {
    let mut summary: Value = json(&folder.join("summary.json"));
    for stage in summary["stages"].as_object_mut().unwrap().values_mut() {
        stage.as_object_mut().unwrap().remove("busy_ms").unwrap();
    }
    summary
}

#[test]
fn on_a_simulated_log() {
    let folder = TempDir::new().unwrap();
    let (log, _) = simulate(folder.path(), "robots.mcap", &["--robots", "3", "--seed", "5"]);
    assert_same_output(folder.path(), &log, &WAYS);
}

#[test]
fn a_simulation_depends_on_its_seed_only() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, seed: &str| {
        let (log, truth) = simulate(folder.path(), name, &["--robots", "2", "--seed", seed]);
        (std::fs::read(log).unwrap(), std::fs::read(truth).unwrap())
    };
    assert!(write("a.mcap", "3") == write("b.mcap", "3"));
    assert!(write("a.mcap", "3") != write("c.mcap", "4"));
}

//! A run that is interrupted ends soon, fails, and leaves a log that can be read and says that it is not complete.
#![cfg(unix)]
use crate::support::{gridweave, left_over, part, signal, start, wait_until};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// It goes on until it is interrupted.
const ENDLESS: &str = r#"
[pipeline]
name = "endless"

[stages.source]
kind = "troubled_source"
count = 1_000_000_000

[stages.stage]
kind = "troubled_stage"
inputs = ["source"]

[stages.output]
kind = "mcap_sink"
inputs = ["source", "stage"]
"#;

#[test]
fn the_output_can_be_read_and_says_that_it_is_not_complete() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("endless.toml"), ENDLESS).unwrap();
    for (engine, name) in [
        ("single", "INT"),
        ("threads", "INT"),
        ("threads-ipc", "TERM"),
        ("threads-ipc", "QUIT"),
        ("processes", "USR1"),
        ("threads", "ALRM"),
        ("threads-ipc", "USR2"),
    ] {
        let output = folder.path().join(format!("{engine}-{name}.mcap"));
        let run =
            start(folder.path(), &["run", "endless.toml", "-o", output.to_str().unwrap(), "--engine", engine], &[]);
        let id = run.id();
        wait_until("output", || fs::metadata(part(&output)).is_ok_and(|file| file.len() > 100_000));
        signal(id, name);
        run.wait().assert(1, &["the run was interrupted"]);
        assert_eq!(left_over(id), Vec::<PathBuf>::new());

        let bytes = fs::read(&output).unwrap();
        let written = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
        assert!(written > 0, "{engine}");
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, written as u64);
        let record = mcap::read::metadata(
            &bytes,
            summary.metadata_indexes.iter().find(|index| index.name == "gridweave").unwrap(),
        )
        .unwrap();
        assert_eq!(record.metadata["complete"], "false");
        assert_eq!(record.metadata["reason"], "the run was interrupted");
        let info = gridweave(folder.path(), &["info", output.to_str().unwrap()]);
        info.assert(0, &[&format!("{written} messages"), "ended early", "the run was interrupted"]);
    }
}

#[test]
fn a_recovery_that_is_interrupted_leaves_the_earlier_file_and_no_part() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("endless.toml"), ENDLESS.replace("count = 1_000_000_000", "count = 300_000")).unwrap();
    gridweave(folder.path(), &["run", "endless.toml", "-o", "log.mcap"]).assert(0, &[]);
    let output = folder.path().join("whole.mcap");
    fs::write(&output, "earlier").unwrap();
    let run = start(folder.path(), &["recover", "log.mcap", "-o", "whole.mcap"], &[]);
    wait_until("output", || part(&output).exists() || fs::metadata(&output).is_ok_and(|file| file.len() > 100));
    signal(run.id(), "TERM");
    let status = run.wait().status;
    assert!(!part(&output).exists());
    assert_eq!(status != 0, fs::read(&output).unwrap() == b"earlier", "{status}");
}

/// A stage that works for ever on its first message.
const LONG_CALL: &str = r#"
[pipeline]
name = "long_call"

[stages.source]
kind = "troubled_source"
count = 100

[stages.stage]
kind = "troubled_stage"
inputs = ["source"]
at = 1
what = "hold"

[stages.output]
kind = "mcap_sink"
inputs = ["stage"]
"#;

#[test]
fn a_run_that_is_interrupted_in_the_long_work_of_a_stage_ends_without_it_and_leaves_only_the_earlier_output() {
    for engine in ["single", "threads", "threads-ipc", "processes"] {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("long_call.toml"), LONG_CALL).unwrap();
        fs::write(folder.path().join("out.mcap"), "earlier").unwrap();
        let run = start(folder.path(), &["run", "long_call.toml", "-o", "out.mcap", "--engine", engine], &[]);
        let id = run.id();
        let held = folder.path().join("held");
        wait_until("the work of the stage", || held.exists());
        signal(id, "TERM");
        run.wait().assert(1, &["the run was interrupted"]);
        assert_eq!(left_over(id), Vec::<PathBuf>::new(), "{engine}");
        assert_eq!(fs::read_to_string(folder.path().join("out.mcap")).unwrap(), "earlier");
        assert!(!part(&folder.path().join("out.mcap")).exists(), "{engine}");
    }
}

//! Each call on an output that can fail, in turn: writes, seeks, the sync to the disk, and the rename. A library that
//! is loaded before the C library makes one of them fail. What was there before stays, the command fails, and it names
//! the file and the cause.

use crate::support::{LogBuilder, TestMap, gridweave_with, part};
use gridweave_logs::map_file::{self, GridMap};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

const EARLIER: &[u8] = b"what was there before";
const CALLS: [&str; 5] = ["write", "seek", "truncate", "sync", "rename"];
/// What the system says of EIO.
const CAUSE: &str = "Input/output error";

/// The library.
fn library(folder: &Path) -> PathBuf {
    let library = folder.join("failing_calls.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/end_to_end/failing_calls.c");
    let built =
        Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).args([source, "-ldl"]).output().unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    library
}

/// Runs a command again and again, each time with another call on `output` that fails. Returns the number of failures
/// by call.
#[track_caller]
fn fail_each_call(args: &[&str], output: &str, prepare: impl Fn(&Path)) -> [usize; CALLS.len()] {
    let folder = TempDir::new().unwrap();
    let library = library(folder.path());
    prepare(folder.path());
    let (output, mark) = (folder.path().join(output), folder.path().join("mark"));
    let name = output.file_name().unwrap().to_str().unwrap();
    CALLS.map(|call| {
        let mut failures = 0;
        loop {
            fs::write(&output, EARLIER).unwrap();
            fs::remove_file(&mark).ok();
            let at = (failures + 1).to_string();
            let [library, output_path, mark_path] = [&library, &output, &mark].map(|path| path.to_str().unwrap());
            let variables = [
                ("LD_PRELOAD", library),
                ("FAIL_CALL", call),
                ("FAIL_PATH", output_path),
                ("FAIL_AT", &at),
                ("FAIL_MARK", mark_path),
            ];
            let ended = gridweave_with(folder.path(), args, &variables);
            let text = ended.text();
            assert!(!text.contains("panicked"), "{call} {at}: {ended:#?}");
            if !mark.exists() {
                // There are no more such calls. Maps that cannot be merged are no failure.
                assert!([0, 3].contains(&ended.status), "{call} {at}: {ended:#?}");
                assert!(fs::read(&output).unwrap() != EARLIER);
                assert!(!part(&output).exists(), "{call} {at}");
                return failures;
            }
            failures += 1;
            assert_eq!(ended.status, 1, "{call} {at}: {ended:#?}");
            assert!(text.contains(name) && text.contains(CAUSE), "{call} {at}: {ended:#?}");
            assert_eq!(fs::read(&output).unwrap(), EARLIER, "{call} {at}: {ended:#?}");
        }
    })
}

/// A log with two rooms, and other messages in chunks of their own.
fn log(folder: &Path) {
    let mut log = LogBuilder::new(&folder.join("input.mcap"));
    log.map(0.0, "robot1", &TestMap::room()).map(0.0, "robot2", &TestMap::room());
    log.finish();
}

#[test]
fn a_log_of_which_any_call_fails_leaves_the_earlier_one() {
    for args in [
        ["convert", "input.mcap", "-o", "output.mcap"].as_slice(),
        &["convert", "input.mcap", "-o", "output.bag"],
        &["merge", "input.mcap", "-o", "output.mcap", "--engine", "single"],
        &["merge", "input.mcap", "-o", "output.mcap", "--engine", "processes"],
    ] {
        let [writes, _, _, syncs, renames] = fail_each_call(args, args[3], log);
        assert!(writes > 2 && syncs == 1 && renames == 1, "{args:?}: {writes} {syncs} {renames}");
    }
}

#[test]
fn other_outputs_of_which_any_call_fails_leave_the_earlier_one() {
    let TestMap { info, mut cells } = TestMap::filled(60, 50, 0.05, 0);
    cells[..3 * 60].fill(100);
    let map = GridMap { info, cells };
    let maps =
        |folder: &Path| ["a.yaml", "b.yaml"].iter().for_each(|name| map_file::save(&folder.join(name), &map).unwrap());
    let merge =
        ["merge", "a.yaml", "b.yaml", "-o", "merged.yaml", "--picture", "merged.png", "--summary", "summary.json"];
    for output in ["merged.yaml", "merged.pgm", "merged.png", "summary.json"] {
        let [writes, _, _, syncs, renames] = fail_each_call(&merge, output, maps);
        assert!(writes > 0 && syncs == 1 && renames == 1, "{output}: {writes} {syncs} {renames}");
    }
}

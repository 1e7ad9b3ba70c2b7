//! Too little address space (`ulimit -v`): a run that cannot keep the limit is refused, and what was there before
//! stays.

use crate::support::{Ended, LogBuilder, SMALL_BUILDING, TestMap, gridweave_program, part, simulate, start_program};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Runs a merge of two rooms with so many kilobytes of address space.
fn merge_within(folder: &Path, kilobytes: &str, engine: &str) -> Ended {
    let mut log = LogBuilder::new(&folder.join("input.mcap"));
    log.map(0.0, "robot1", &TestMap::room()).map(0.0, "robot2", &TestMap::room());
    log.finish();
    run_merge_within(folder, kilobytes, engine)
}

/// Merges `input.mcap` with so many kilobytes of address space.
fn run_merge_within(folder: &Path, kilobytes: &str, engine: &str) -> Ended {
    let limited = "ulimit -v \"$1\"; shift; exec \"$@\"";
    let program = gridweave_program().to_str().unwrap();
    let merge = ["merge", "input.mcap", "-o", "output.mcap", "--engine", engine];
    let args = [&["-c", limited, "sh", kilobytes, program], &merge[..]].concat();
    start_program("sh".as_ref(), folder, &args, &[]).wait()
}

#[test]
fn a_run_of_threads_within_too_little_address_space_is_refused_and_says_what_to_do() {
    let folder = TempDir::new().unwrap();
    let output = folder.path().join("output.mcap");
    fs::write(&output, "what was there before").unwrap();
    for engine in ["threads", "threads-ipc", "processes"] {
        let ended = merge_within(folder.path(), "700000", engine);
        ended.assert(1, &["683 MB (`ulimit -v`)", "--engine single", engine]);
        assert_eq!(fs::read_to_string(&output).unwrap(), "what was there before");
        assert!(!part(&output).exists());
    }
}

#[test]
fn a_run_in_one_thread_works_within_little_address_space_or_is_refused() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "input.mcap", &SMALL_BUILDING);
    for kilobytes in [100_000, 140_000, 180_000, 200_000, 230_000, 260_000, 300_000, 350_000, 400_000, 500_000] {
        let ended = run_merge_within(folder.path(), &kilobytes.to_string(), "single");
        match kilobytes < 128 << 10 {
            true => ended.assert(1, &["at least 128 MB", "97 MB (`ulimit -v`): raise that limit"]),
            false => ended.assert(0, &["merged 2 of 2 robots"]),
        }
    }
}

#[test]
fn a_run_in_one_thread_warns_of_little_address_space() {
    let folder = TempDir::new().unwrap();
    let ended = merge_within(folder.path(), "500000", "single");
    assert!([0, 3].contains(&ended.status), "{ended:#?}");
    assert!(ended.stderr.contains("limited to 488 MB (`ulimit -v`)"), "{ended:#?}");
}

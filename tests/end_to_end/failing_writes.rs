//! Writes that fail, at each place in turn, and files that cannot be opened: what was there before stays, the command
//! fails, and it names the cause.
//!
//! A limit of the size of files (`ulimit -f`) makes the write fail that crosses it, as on a full disk. It is raised
//! block by block until all fits.

use crate::support::{Ended, LogBuilder, SMALL_BUILDING, TestMap, gridweave, gridweave_program, start_program};
use gridweave_logs::map_file::{self, GridMap};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Runs `gridweave` with so many blocks of 512 bytes as the limit of each file that it writes.
fn run_limited(folder: &Path, blocks: usize, args: &[&str]) -> Ended {
    let limited = "ulimit -f \"$1\"; shift; exec \"$@\"";
    let (blocks, program) = (blocks.to_string(), gridweave_program().to_str().unwrap());
    let args = [&["-c", limited, "sh", &blocks, program], args].concat();
    start_program("sh".as_ref(), folder, &args, &[]).wait()
}

/// Runs a command with each limit until all that it writes fits. Each time before, its `output` says something else,
/// which stays if the command fails.
#[track_caller]
fn fail_at_each_block(folder: &Path, args: &[&str], outputs: &[&str], most: usize) {
    let earlier = b"what was there before";
    for blocks in 0..most {
        for output in outputs {
            fs::write(folder.join(output), earlier).unwrap();
        }
        let ended = run_limited(folder, blocks, args);
        assert!(!ended.text().contains("panicked"), "{blocks} blocks: {ended:#?}");
        // Maps that cannot be merged are no failure.
        if [0, 3].contains(&ended.status) {
            assert!(blocks > 2, "{ended:#?}");
            assert!(outputs.iter().all(|output| fs::read(folder.join(output)).unwrap() != earlier));
            return;
        }
        assert_eq!(ended.status, 1, "{blocks} blocks: {ended:#?}");
        let is_named = outputs.iter().chain(&["summary.json"]).any(|output| ended.stderr.contains(output));
        assert!(is_named, "{blocks} blocks: {ended:#?}");
        for output in outputs {
            assert_eq!(fs::read(folder.join(output)).unwrap(), earlier, "{blocks} blocks: {ended:#?}");
        }
    }
    panic!("{most} blocks are not enough");
}

#[test]
fn a_picture_and_a_report_that_are_too_large_leave_the_earlier_ones() {
    let folder = TempDir::new().unwrap();
    let TestMap { info, mut cells } = TestMap::filled(60, 50, 0.05, 0);
    cells[..3 * 60].fill(100);
    map_file::save(&folder.path().join("a.yaml"), &GridMap { info, cells }).unwrap();
    gridweave(folder.path(), &["convert", "robot1=a.yaml", "-o", "a.mcap"]).assert(0, &[]);
    for (args, output) in
        [(["render", "a.yaml", "-o", "a.svg"], "a.svg"), (["report", "a.mcap", "-o", "a.html"], "a.html")]
    {
        fs::write(folder.path().join(output), "earlier").unwrap();
        run_limited(folder.path(), 1, &args).assert(1, &[output, "ulimit -f"]);
        assert_eq!(fs::read(folder.path().join(output)).unwrap(), b"earlier");
        assert!(!folder.path().join(format!("{output}.part")).exists());
    }
}

#[test]
fn of_several_outputs_of_a_run_none_is_replaced_if_one_cannot_be_written() {
    let folder = TempDir::new().unwrap();
    let TestMap { info, mut cells } = TestMap::filled(60, 50, 0.05, 0);
    cells[..3 * 60].fill(100);
    for name in ["a.yaml", "b.yaml"] {
        map_file::save(&folder.path().join(name), &GridMap { info, cells: cells.clone() }).unwrap();
    }
    let outputs = ["merged.mcap", "map.yaml", "map.pgm", "merged.png", "summary.json"];
    let merge = ["merge", "a.yaml", "b.yaml", "-o", "merged.mcap"];
    let files = ["--map", "map.yaml", "--picture", "merged.png", "--summary", "summary.json"];
    for engine in ["single", "threads"] {
        let args = [&merge[..], &files[..], &["--engine", engine]].concat();
        fail_at_each_block(folder.path(), &args, &outputs, 200);
    }
}

#[test]
fn a_simulation_whose_log_cannot_be_written_leaves_the_earlier_log_and_its_truth() {
    let folder = TempDir::new().unwrap();
    let outputs = ["s.mcap", "s.truth.json"].map(|name| folder.path().join(name));
    outputs.iter().for_each(|output| fs::write(output, "earlier").unwrap());
    let simulate = [&["simulate", "-o", "s.mcap"], &SMALL_BUILDING[..]].concat();
    for blocks in [0, 16, 40] {
        run_limited(folder.path(), blocks, &simulate).assert(1, &["cannot write the ", "s."]);
        assert!(outputs.iter().all(|output| fs::read(output).unwrap() == b"earlier"), "{blocks} blocks");
    }
    assert!(!folder.path().join("s.truth.json.part").exists());
    run_limited(folder.path(), 1_000_000, &simulate).assert(0, &[]);
    assert!(outputs.iter().all(|output| fs::read(output).unwrap() != b"earlier"));
}

#[test]
fn a_run_without_free_file_descriptors_says_so() {
    let folder = TempDir::new().unwrap();
    let mut log = LogBuilder::new(&folder.path().join("input.mcap"));
    log.map(0.0, "robot1", &TestMap::room()).map(0.0, "robot2", &TestMap::room());
    log.finish();
    let limited = "ulimit -n \"$1\"; shift; exec \"$@\"";
    let program = gridweave_program().to_str().unwrap();
    let merge = ["merge", "input.mcap", "-o", "output.mcap", "--engine", "threads-ipc"];
    for descriptors in ["12", "40", "100"] {
        let args = [&["-c", limited, "sh", descriptors, program], &merge[..]].concat();
        let ended = start_program("sh".as_ref(), folder.path(), &args, &[]).wait();
        ended.assert(1, &["ulimit -n"]);
        assert!(!folder.path().join("output.mcap").exists());
    }
}

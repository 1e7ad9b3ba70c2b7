//! Time and memory of a complete merge, from the command line to the closed output.
//!
//!     GRIDWEAVE_LOGS=FOLDER cargo bench -p gridweave --bench replay
//!
//! Without a folder of logs it simulates one. The reference, in the same run, is a copy of the log by the `mcap` crate
//! (read, decompress, compress, write), which is the least that any tool with an MCAP output does.

// A bench that cannot go on may panic.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

const RUNS: usize = 7;
const ENGINES: [&str; 4] = ["single", "threads", "threads-ipc", "processes"];

fn main() {
    let folder = tempfile::TempDir::new().unwrap();
    let logs = match std::env::var_os("GRIDWEAVE_LOGS") {
        Some(logs) => logs_in(Path::new(&logs)),
        None => vec![simulated(folder.path())],
    };
    println!(
        "| log | messages | copy, s | {} |",
        ENGINES
            .map(|engine| format!("{engine}, s (x copy){}", if is_one_process(engine) { ", MB" } else { "" }))
            .join(" | ")
    );
    println!("| --- | --- | --- |{}", " --- |".repeat(ENGINES.len()));
    for log in logs {
        let output = folder.path().join("out.mcap");
        let copies = (0..RUNS).map(|_| copy(&log, &output)).collect::<Vec<_>>();
        let messages = copies[0].1;
        let copy = median(copies.into_iter().map(|(seconds, _)| seconds).collect());
        let cells: Vec<String> = ENGINES
            .iter()
            .map(|engine| {
                let runs: Vec<(f64, u64)> = (0..RUNS).map(|_| merge(&log, &output, engine)).collect();
                let memory = runs.iter().map(|(_, memory)| *memory).max().unwrap_or_default();
                let seconds = median(runs.into_iter().map(|(seconds, _)| seconds).collect());
                let memory = if is_one_process(engine) { format!(", {}", memory / 1024) } else { String::new() };
                format!("{seconds:.2} ({:.1}){memory}", seconds / copy)
            })
            .collect();
        let name = log.file_stem().unwrap().to_string_lossy();
        println!("| {name} | {messages} | {copy:.3} | {} |", cells.join(" | "));
    }
}

/// Whether one process holds all the memory of the run.
fn is_one_process(engine: &str) -> bool {
    engine != "processes"
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let mut logs: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    logs.retain(|path| path.extension().is_some_and(|end| end == "mcap"));
    logs.sort();
    logs
}

fn simulated(folder: &Path) -> PathBuf {
    let log = folder.join("simulated.mcap");
    let status = Command::new(env!("CARGO_BIN_EXE_gridweave"))
        .args(["simulate", "-o"])
        .arg(&log)
        .stdout(Stdio::null())
        .status()
        .unwrap();
    assert!(status.success());
    log
}

/// Copies a log. Returns the time in seconds and the number of messages.
fn copy(input: &Path, output: &Path) -> (f64, u64) {
    let start = Instant::now();
    let bytes = std::fs::read(input).unwrap();
    let file = std::io::BufWriter::new(std::fs::File::create(output).unwrap());
    let mut writer = mcap::Writer::new(file).unwrap();
    let mut count = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
        count += 1;
    }
    writer.finish().unwrap();
    (start.elapsed().as_secs_f64(), count)
}

/// Merges a log. Returns the time in seconds and the peak memory, KiB.
fn merge(input: &Path, output: &Path, engine: &str) -> (f64, u64) {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_gridweave"))
        .args(["run", "tag_merge", "--input"])
        .arg(input)
        .arg("--output")
        .arg(output)
        .args(["--engine", engine])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let memory = peak_memory(&mut child);
    let seconds = start.elapsed().as_secs_f64();
    let status = child.wait().unwrap().code();
    assert!(matches!(status, Some(0 | 3)), "the merge of {} ended with {status:?}", input.display());
    (seconds, memory)
}

/// Waits for the end of a process and returns its peak memory from `/proc`, KiB; 0 where there is no `/proc`.
fn peak_memory(child: &mut std::process::Child) -> u64 {
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    while child.try_wait().unwrap().is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let held = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        peak = peak.max(held.unwrap_or(0));
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    peak
}

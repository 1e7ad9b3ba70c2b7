//! What runs of several processes do to the machine: processes, shared memory, folders, and the logs that they write.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

/// A source, a diamond of two stages, one that joins them with the source itself, and a log. It does not end by itself.
pub(crate) const DIAMOND: &str = r#"
[pipeline]
name = "diamond"
depth = 4
stall_timeout = 2.0
memory_limit = 300_000_000

[stages.source]
kind = "troubled_source"
count = 1_000_000_000
pause = 100

[stages.middle]
kind = "troubled_stage"
inputs = ["source"]

[stages.other]
kind = "troubled_stage"
inputs = ["source"]

[stages.join]
kind = "troubled_stage"
inputs = { in = ["middle", "other", "source"] }

[stages.output]
kind = "mcap_sink"
inputs = ["join"]
"#;

/// The name of the run of the supervisor with this process number.
pub(crate) fn run_name(run: u32) -> String {
    format!("gw{run}_0_")
}

/// The folder of a run's files.
pub(crate) fn run_folder(run: u32) -> PathBuf {
    use std::os::unix::fs::MetadataExt;
    let user = fs::metadata("/proc/self").unwrap().uid();
    Path::new(&format!("/tmp/gridweave-{user}")).join(run_name(run))
}

/// What a run has left in shared memory and in its folder.
pub(crate) fn left_over(run: u32) -> Vec<PathBuf> {
    let is_of_run = |path: &PathBuf| path.to_string_lossy().contains(&format!("/gw{run}_"));
    let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path()).filter(is_of_run);
    shared.chain(Some(run_folder(run)).filter(|folder| folder.exists())).collect()
}

/// The processes of a run, by name.
pub(crate) fn processes(run: u32) -> Vec<(u32, String)> {
    let folder = run_folder(run).to_string_lossy().into_owned();
    let of_process = |id: u32| {
        let line = fs::read(format!("/proc/{id}/cmdline")).ok()?;
        let words: Vec<String> =
            line.split(|byte| *byte == 0).map(|word| String::from_utf8_lossy(word).into()).collect();
        let place = words.iter().position(|word| *word == folder)?;
        Some((id, words.get(place + 1)?.clone()))
    };
    let ids = fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    ids.filter_map(of_process).collect()
}

/// Sends a signal to a process.
pub(crate) fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &process.to_string()]).status().unwrap().success());
}

/// Waits until something is so that nothing tells of: files grow, and runs go on, without a word to others.
#[track_caller]
pub(crate) fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {what}");
        thread::park_timeout(Duration::from_millis(2));
    }
}

/// What the log says of its end, and how many messages it holds.
pub(crate) fn outcome(log: &Path) -> (String, usize) {
    let bytes = fs::read(log).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let record = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    (record.metadata.get("reason").cloned().unwrap_or_default(), messages)
}

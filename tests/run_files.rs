//! What runs of several processes do to the machine: processes, shared memory, folders, and the logs that they write.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

/// A source, a diamond of two stages, one that joins them with the source itself, and a log. It does not end by itself.
pub const DIAMOND: &str = r#"
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

/// What the name of the run of the supervisor with this process number begins with.
pub fn run_name(run: u32) -> String {
    format!("gw{run}_")
}

/// The folder of the files of all runs of this user.
fn user_folder() -> PathBuf {
    use std::os::unix::fs::MetadataExt;
    let user = fs::metadata("/proc/self").unwrap().uid();
    let own = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let own = own.filter(|folder| fs::metadata(folder).is_ok_and(|folder| folder.uid() == user));
    own.map_or_else(|| PathBuf::from(format!("/tmp/gridweave-{user}")), |folder| folder.join("gridweave"))
}

/// The folder of a run's files, if it is there.
pub fn run_folder(run: u32) -> Option<PathBuf> {
    let entries = fs::read_dir(user_folder()).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    let name = format!("/{}", run_name(run));
    entries.into_iter().find(|path| path.to_string_lossy().contains(&name))
}

/// What a run has left in shared memory and in its folder.
pub fn left_over(run: u32) -> Vec<PathBuf> {
    let is_of_run = |path: &PathBuf| path.to_string_lossy().contains(&format!("/gw{run}_"));
    let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path()).filter(is_of_run);
    shared.chain(run_folder(run)).collect()
}

/// The processes of a run, by name.
pub fn processes(run: u32) -> Vec<(u32, String)> {
    let name = format!("/{}", run_name(run));
    let of_process = |id: u32| {
        let line = fs::read(format!("/proc/{id}/cmdline")).ok()?;
        let words: Vec<String> =
            line.split(|byte| *byte == 0).map(|word| String::from_utf8_lossy(word).into()).collect();
        let place = words.iter().position(|word| word.contains(&name))?;
        Some((id, words.get(place + 1)?.clone()))
    };
    let ids = fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    ids.filter_map(of_process).collect()
}

/// Sends a signal to a process.
pub fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &process.to_string()]).status().unwrap().success());
}

/// Waits for a condition without a notification: files grow and runs proceed silently.
#[track_caller]
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {what}");
        thread::park_timeout(Duration::from_millis(2));
    }
}

/// The path of a file while it is written.
pub fn part(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// What the log says of its end, and how many messages it holds.
pub fn outcome(log: &Path) -> (String, usize) {
    let bytes = fs::read(log).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let index = summary.metadata_indexes.iter().find(|index| index.name == "gridweave").unwrap();
    let record = mcap::read::metadata(&bytes, index).unwrap();
    (record.metadata.get("reason").cloned().unwrap_or_default(), messages)
}

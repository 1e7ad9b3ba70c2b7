//! A run that is interrupted ends soon, fails, and leaves a log that can be read and says that it is not complete.
#![cfg(unix)]
use crate::support::{Ended, LogBuilder, TestMap, gridweave, start};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A log of so many messages.
fn long_log(path: &Path, messages: u32) {
    let mut log = LogBuilder::new(path);
    log.map(0.0, "robot1", &TestMap::room());
    for message in 0..messages {
        log.raw(1e-3 * f64::from(message), "/robot1/camera", "my_msgs/msg/Strange", &message.to_le_bytes());
    }
    log.finish();
}

/// Starts a merge, and sends it a signal when it has written some of its output.
fn interrupt(folder: &Path, engine: &str, signal: &str) -> Ended {
    let output = folder.join("out.mcap");
    let _ = fs::remove_file(&output);
    let run = start(folder, &["merge", "in.mcap", "-o", "out.mcap", "--engine", engine], &[]);
    let id = run.id();
    let begin = Instant::now();
    while fs::metadata(&output).map_or(0, |file| file.len()) < 100_000 && begin.elapsed() < Duration::from_secs(60) {
        thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args([&format!("-{signal}"), &id.to_string()]).status().unwrap().success());
    let ended = run.wait();
    assert_eq!(files_in_shared_memory(id), [""; 0]);
    ended
}

/// The files that the process with this number has left in shared memory.
fn files_in_shared_memory(id: u32) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir("/dev/shm") else { return Vec::new() };
    let names = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(&format!("gw{id}_"))).collect()
}

#[test]
fn the_output_can_be_read_and_says_that_it_is_not_complete() {
    let folder = TempDir::new().unwrap();
    let mut messages = 200_000;
    long_log(&folder.path().join("in.mcap"), messages);
    for (engine, signal) in [("single", "INT"), ("threads", "INT"), ("threads-ipc", "TERM")] {
        let mut ended = interrupt(folder.path(), engine, signal);
        // A run that came to its end before the signal came to it shows nothing.
        while ended.status == 0 && messages < 10_000_000 {
            messages *= 4;
            long_log(&folder.path().join("in.mcap"), messages);
            ended = interrupt(folder.path(), engine, signal);
        }
        ended.assert(1, &["the run was interrupted"]);

        let output = fs::read(folder.path().join("out.mcap")).unwrap();
        let read: Vec<mcap::Message<'_>> = mcap::MessageStream::new(&output).unwrap().map(Result::unwrap).collect();
        let written = read.len();
        assert!((1..messages as usize).contains(&written), "{engine}: {written}");
        let summary = mcap::Summary::read(&output).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, written as u64);
        let record = mcap::read::metadata(&output, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(record.metadata["complete"], "false");
        assert_eq!(record.metadata["reason"], "the run was interrupted");
        let info = gridweave(folder.path(), &["info", "out.mcap"]);
        info.assert(0, &[&format!("{written} messages"), "ended early", "the run was interrupted"]);
    }
}

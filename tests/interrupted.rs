//! A run that is interrupted ends soon, fails, and leaves a log that can be read and says that it is not complete.
#![cfg(unix)]

mod support;

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;
use support::{LogBuilder, TestMap, gridweave, start};
use tempfile::TempDir;

/// How long a test waits before it gives up.
const WATCHDOG: Duration = Duration::from_secs(120);

/// A log of 20 MB that cannot be compressed.
fn long_log(path: &Path) {
    let mut log = LogBuilder::new(path);
    log.map(0.0, "robot1", &TestMap::room());
    let mut state = 1_u64;
    for message in 0..10_000 {
        let bytes: Vec<u8> = (0..250)
            .flat_map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state ^ (state >> 29)).to_le_bytes()
            })
            .collect();
        log.raw(0.01 * f64::from(message), "/robot1/camera", "my_msgs/msg/Strange", &bytes);
    }
    log.finish();
}

/// Interrupts a merge when it has written some of its output, and gives the output.
///
/// The output is a pipe, so that the run cannot come to its end before the test lets it.
fn interrupt(folder: &Path, engine: &str, signal: &str) -> Vec<u8> {
    let pipe = folder.join("pipe");
    let _ = std::fs::remove_file(&pipe);
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (sender, receiver) = channel();
    let run = start(folder, &["merge", "in.mcap", "-o", "pipe", "--engine", engine], &[]);
    let id = run.id();
    thread::spawn(move || {
        let mut file = File::open(pipe).unwrap();
        let mut bytes = vec![0; 1 << 14];
        while let Ok(length @ 1..) = file.read(&mut bytes) {
            if sender.send(bytes[..length].to_vec()).is_err() {
                return;
            }
            // Slow enough for the run to take note of the signal long before all is read.
            thread::sleep(Duration::from_millis(1));
        }
    });
    let mut output = receiver.recv_timeout(WATCHDOG).unwrap();
    assert!(Command::new("kill").args([&format!("-{signal}"), &id.to_string()]).status().unwrap().success());
    loop {
        match receiver.recv_timeout(WATCHDOG) {
            Ok(bytes) => output.extend(bytes),
            Err(error) => break assert_eq!(error.to_string(), "channel is empty and sending half is closed"),
        }
    }
    run.wait().assert(1, &["interrupted"]);
    assert_eq!(files_in_shared_memory(id), [""; 0]);
    output
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
    long_log(&folder.path().join("in.mcap"));
    for (engine, signal) in [("single", "INT"), ("threads", "INT"), ("threads-ipc", "TERM")] {
        let output = interrupt(folder.path(), engine, signal);
        let messages = mcap::MessageStream::new(&output).unwrap().map(|message| message.unwrap()).count();
        assert!((1..10_000).contains(&messages), "{engine}: {messages}");
        let summary = mcap::Summary::read(&output).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, messages as u64);
        let record = mcap::read::metadata(&output, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(record.metadata["complete"], "false");
        assert_eq!(record.metadata["reason"], "the run was interrupted");

        std::fs::write(folder.path().join("out.mcap"), &output).unwrap();
        let info = gridweave(folder.path(), &["info", "out.mcap"]);
        info.assert(0, &[&format!("{messages} messages"), "ended early", "the run was interrupted"]);
    }
}

//! A closed standard output or standard error is no failure of a command, and never a panic.

use crate::support::{gridweave_program, simulate};
use std::process::{Command, Stdio};
use tempfile::TempDir;

#[test]
fn no_command_panics_when_its_output_is_closed() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &["--robots", "2", "--set", "duration=20"]);
    let commands: [&[&str]; 10] = [
        &["kinds"],
        &["kinds", "--json"],
        &["kinds", "icp_refiner"],
        &["graph", "tag_merge"],
        &["check", "tag_merge", "map_merge"],
        &["info", "in.mcap"],
        &["info", "in.mcap", "--json"],
        &["clean"],
        &["simulate", "-o", "other.mcap", "--robots", "1", "--set", "duration=5"],
        &["merge", "in.mcap", "-o", "out.mcap"],
    ];
    for args in commands {
        // The reader is gone before anything is printed.
        let (_, output) = std::io::pipe().unwrap();
        let child = Command::new(gridweave_program())
            .args(args)
            .current_dir(folder.path())
            .stdout(output)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let ended = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert!(matches!(ended.status.code(), Some(0 | 3)) && !stderr.contains("panicked"), "{args:?}: {stderr}");
    }
}

#[test]
fn no_command_panics_when_its_standard_error_is_closed() {
    let folder = TempDir::new().unwrap();
    for (args, status) in [(&["info", "missing.mcap"][..], 1), (&["run", "missing"], 2), (&["check", "missing"], 2)] {
        let (_, output) = std::io::pipe().unwrap();
        let mut command = Command::new(gridweave_program());
        command.args(args).current_dir(folder.path()).stdout(Stdio::null()).stderr(output);
        // A panic ends a program with 101.
        assert_eq!(command.status().unwrap().code(), Some(status), "{args:?}");
    }
}

#[test]
fn results_and_help_that_cannot_be_written_are_an_error() {
    for arg in ["kinds", "--help", "--version"] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let child = Command::new(gridweave_program()).arg(arg).stdout(full).stderr(Stdio::piped()).spawn().unwrap();
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(1), "{arg}");
        assert!(String::from_utf8_lossy(&ended.stderr).contains("cannot write to standard output"), "{arg}");
    }
}

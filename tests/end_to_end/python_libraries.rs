//! The libraries for Python that people read logs with (`mcap`, `mcap-ros2-support`, `rosbags`) read every message that
//! is written.

use crate::support::{SMALL_BUILDING, gridweave, simulate};
use gridweave_logs::reader::{LogFile, LogReader};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// Runs a program, and gives what it prints.
#[track_caller]
pub(crate) fn output(program: &Path, args: &[&OsStr]) -> String {
    let child = Command::new(program).args(args).stdin(Stdio::null()).output();
    let ended = child.unwrap_or_else(|error| panic!("cannot start {}: {error}", program.display()));
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{} {args:?} failed: {errors}", program.display());
    String::from_utf8(ended.stdout).unwrap()
}

/// The interpreter of a virtual environment with the libraries.
pub(crate) fn python(folder: &Path) -> PathBuf {
    let environment = folder.join("python");
    output(Path::new("python3"), &["-m".as_ref(), "venv".as_ref(), environment.as_ref()]);
    let python = environment.join("bin/python");
    let requirements = script("requirements.txt");
    let install = ["-m", "pip", "install", "--quiet", "--only-binary", ":all:", "--requirement"];
    let install: Vec<&OsStr> = install.iter().map(OsStr::new).chain([requirements.as_ref()]).collect();
    output(&python, &install);
    python
}

/// A script that uses the libraries.
pub(crate) fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("end_to_end/python_libraries").join(name)
}

/// How many messages every topic of a log has.
fn counts(log: &Path) -> BTreeMap<String, u64> {
    let mut reader = LogReader::new(vec![LogFile::open(log).unwrap()]);
    let files = reader.files().clone();
    let mut counts = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        *counts.entry(files[0].channel(message.channel).unwrap().topic).or_default() += 1;
    }
    counts
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_libraries_read_every_message() {
    let folder = TempDir::new().unwrap();
    let python = python(folder.path());
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merge/"]).assert(0, &["merged 2 of 2"]);
    gridweave(folder.path(), &["run", "topological", "--input", "in.mcap", "-o", "run/"]);
    gridweave(folder.path(), &["convert", "in.mcap", "-o", "convert/"]).assert(0, &[]);
    let script = script("read.py");
    for name in ["merge", "run", "convert"] {
        let bag = folder.path().join(name);
        let read = output(&python, &[script.as_ref(), bag.as_ref()]);
        let read: BTreeMap<String, u64> = serde_json::from_str(&read).unwrap();
        assert_eq!(read, counts(&bag.join(format!("{name}_0.mcap"))), "{name}");
    }
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn python_libraries_read_every_message_of_a_ros_1_bag() {
    let folder = TempDir::new().unwrap();
    let python = python(folder.path());
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged.bag"]).assert(0, &["merged 2 of 2"]);
    gridweave(folder.path(), &["run", "cut", "--input", "in.mcap", "-o", "plain.bag", "--set", "out.compression=none"])
        .assert(0, &[]);
    for name in ["merged.bag", "plain.bag"] {
        let bag = folder.path().join(name);
        let read = output(&python, &[script("read_ros1.py").as_ref(), bag.as_ref()]);
        let read: BTreeMap<String, u64> = serde_json::from_str(&read).unwrap();
        assert_eq!(read, counts(&bag), "{name}");
    }
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn the_package_of_messages_is_one_that_the_python_libraries_of_colcon_take() {
    let folder = TempDir::new().unwrap();
    let python = python(folder.path());
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/msg/gridweave_msgs");
    let read = output(&python, &[script("package.py").as_ref(), package.as_ref()]);
    let read: serde_json::Value = serde_json::from_str(&read).unwrap();
    let expected = serde_json::json!({
        "name": "gridweave_msgs",
        "build_type": "ament_cmake",
        "build_depends": ["geometry_msgs", "std_msgs"],
        "groups": ["rosidl_interface_packages"],
    });
    assert_eq!(read, expected);
}

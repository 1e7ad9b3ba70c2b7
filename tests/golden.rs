//! The example of a stage of one's own sends what its golden case expects.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the whole repository.
fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Where differences are left to be looked at.
fn differences(name: &str) -> String {
    format!("{}/{name}-differences", env!("CARGO_TARGET_TMPDIR"))
}

#[test]
fn the_example_of_a_stage_of_ones_own_sends_what_is_expected() {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "--quiet", "--package", "gridweave", "--example", "own_stage"]);
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    let cases = "runtime/cli/examples/own_stage_golden";
    cargo.args(["--", "golden", "--partial", "--cases", cases, "--differences", &differences("own_stage")]);
    let ended = cargo.current_dir(repository()).output().unwrap();
    let text = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && text.contains("ok       map_inflater/rooms"), "{text}");
}

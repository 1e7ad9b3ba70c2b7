//! Every stage sends the messages that its golden cases expect, and so does the stage of the example.

use crate::support::{WITHOUT_TROUBLE, gridweave_with};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the whole repository.
fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// Where differences are left to be looked at.
fn differences(name: &str) -> String {
    format!("{}/{name}-differences", env!("CARGO_TARGET_TMPDIR"))
}

#[test]
fn every_stage_sends_what_is_expected() {
    let args = ["golden", "--differences", &differences("golden")];
    let ended = gridweave_with(&repository(), &args, &[WITHOUT_TROUBLE]);
    assert_eq!(ended.status, 0, "{}", ended.text());
}

#[test]
fn the_golden_files_are_small() {
    fn size(folder: &Path) -> u64 {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        entries.map(|path| if path.is_dir() { size(&path) } else { path.metadata().unwrap().len() }).sum()
    }
    let bytes = size(&repository().join("tests/golden"));
    assert!(bytes < 5_000_000, "{bytes} bytes");
}

#[test]
fn the_example_of_a_stage_of_ones_own_sends_what_is_expected() {
    let cases = "pipelines/examples/own_stage_golden";
    let mut example = Command::new(env!("CARGO_BIN_EXE_own_stage"));
    example.args(["golden", "--partial", "--cases", cases, "--differences", &differences("own_stage")]);
    let ended = example.current_dir(repository()).output().unwrap();
    let text = String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && text.contains("ok       map_inflater/rooms"), "{text}");
}

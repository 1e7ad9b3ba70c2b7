//! Every stage sends the messages that its golden cases expect, and so do those of the examples.

use crate::support::{WITHOUT_TROUBLE, gridweave_with, published_program, start_program};
use std::path::{Path, PathBuf};

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
    let folders = ["tests/golden", "pipelines/examples/published/golden"];
    let bytes: u64 = folders.iter().map(|folder| size(&repository().join(folder))).sum();
    assert!(bytes < 5_000_000, "{bytes} bytes");
}

#[test]
fn the_example_of_a_stage_of_ones_own_sends_what_is_expected() {
    let text = golden_of_example(Path::new(env!("CARGO_BIN_EXE_own_stage")), "own_stage", "own_stage_golden");
    assert!(text.contains("ok       map_inflater/rooms"), "{text}");
}

#[test]
fn every_published_method_sends_what_is_expected() {
    let text = golden_of_example(published_program(), "published", "published/golden");
    for kind in gridweave_published::kinds() {
        assert!(text.contains(&format!("ok       {}/", kind.name)), "{} has no case: {text}", kind.name);
    }
}

/// What the golden cases of an example print, none of which fails.
#[track_caller]
fn golden_of_example(program: &Path, name: &str, cases: &str) -> String {
    let cases = format!("pipelines/examples/{cases}");
    let args = ["golden", "--partial", "--cases", &cases, "--differences", &differences(name)];
    let ended = start_program(program, &repository(), &args, &[]).wait();
    assert_eq!(ended.status, 0, "{}", ended.text());
    ended.text()
}

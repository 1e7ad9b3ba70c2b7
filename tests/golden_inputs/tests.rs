//! The inputs of the golden cases are those that the program `golden_inputs` makes.

use crate::cases::{made_up, messages};
use crate::{golden, input};
use std::fs;
use std::path::{Path, PathBuf};

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let below = |path: PathBuf| if path.is_dir() { files(&path) } else { vec![path] };
    entries.flat_map(|entry| below(entry.unwrap().path())).collect()
}

#[test]
fn what_is_made_up_is_what_the_program_makes() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("input.mcap");
    for case in made_up() {
        let input = input(case.kind, case.name);
        case.write(&made);
        let (here, expected) = (messages(&input), messages(&made));
        let differs = here.iter().zip(&expected).position(|(here, expected)| here != expected);
        assert!(
            differs.is_none() && here.len() == expected.len(),
            "{}: {} messages, {} expected, the first that differs is {differs:?}; `cargo run -p gridweave-tests --bin \
             golden_inputs` writes it anew",
            input.display(),
            here.len(),
            expected.len()
        );
    }
}

#[test]
fn every_input_is_made_up_or_a_cut() {
    for input in golden().iter().flat_map(|folder| files(folder)).filter(|path| path.ends_with("input.mcap")) {
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        let folder = input.parent().unwrap();
        let (case, kind) = (name(folder), name(folder.parent().unwrap()));
        let is_made_up = made_up().iter().any(|made| (made.kind, made.name) == (kind.as_str(), case.as_str()));
        assert!(is_made_up || case == "simulated", "nothing makes {}", input.display());
        assert!(!messages(&input).is_empty(), "{} is empty", input.display());
    }
}

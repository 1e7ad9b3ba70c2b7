//! Writes the inputs of the golden cases, `KIND/CASE/input.mcap` in `tests/golden`, and in the crate of the published
//! methods those of its stages:
//!
//!     cargo run -p gridweave-tests --bin golden_inputs             # those that are made up
//!     cargo run -p gridweave-tests --bin golden_inputs -- --cuts   # and those that are cut out of a simulated log
//!
//! What is made up comes out the same whenever the program runs, and the test `golden_inputs` compares it with the
//! files. A cut is what a stage was given in a merge of a simulated log when it was made: it stays as it is when the
//! stages before it change, so that a case tests only its stage. A file that holds the right messages already is
//! not touched. What a stage makes of its input is then blessed with `gridweave golden --bless`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod cases;
mod cuts;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let with_cuts = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--cuts"] => true,
        _ => panic!("usage: golden_inputs [--cuts]"),
    };
    let scratch = tempfile::tempdir().unwrap();
    let made = scratch.path().join("input.mcap");
    for case in cases::made_up() {
        case.write(&made);
        keep(&made, &input(case.kind, case.name));
    }
    if with_cuts {
        let merge = cuts::Merge::new(scratch.path());
        for cut in cuts::CUTS {
            merge.write(&cut, &made);
            keep(&made, &input(cut.kind, cut.name));
        }
    }
}

/// The folders of golden cases: of the stages that ship, and of the published methods.
fn golden() -> [PathBuf; 2] {
    ["golden", "../pipelines/examples/published/golden"]
        .map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
}

/// The input of the case of a stage kind.
fn input(kind: &str, case: &str) -> PathBuf {
    let [shipped, published] = golden();
    let is_published = gridweave_published::kinds().iter().any(|published| published.name == kind);
    if is_published { published } else { shipped }.join(kind).join(case).join("input.mcap")
}

/// Makes a file the input of a case, unless that holds the same messages.
fn keep(made: &Path, input: &Path) {
    if !input.exists() || cases::messages(input) != cases::messages(made) {
        fs::create_dir_all(input.parent().unwrap()).unwrap();
        fs::copy(made, input).unwrap();
        println!("wrote {}", input.display());
    }
}

//! Pipeline files, with all stages that ship, and the files of golden cases.

use super::input::Input;
use super::target::Target;
use gridweave::shipped::registry;
use gridweave_runtime::pipeline::{Overrides, Pipeline, PipelineErrors, SingleStage, TEXT_WIDTH};
use std::fs;
use std::path::{Path, PathBuf};

const WORDS: &[&str] = &[
    "\"",
    "'''",
    "\"\"\"",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    "*",
    "\n",
    "\r",
    "\t",
    "#",
    "\\u0000",
    "-1",
    "1e999",
    "nan",
    "99999999999999999999",
    "{robot}",
    "\u{1f916}",
    "e\u{301}",
    "[[[[[[[[[[[[[[[[",
    "a.b.c.d.e.f.g.h = 1\n",
    "[stages.a]\n",
    "[stage]\n",
    "[pipeline]\n",
    "[robots]\n",
    "kind = ",
    "inputs = [",
    "\"log.*\"",
    "mcap_source",
    "topics = { map = \"/{robot}/map\" }\n",
    "mode = \"live\"\n",
    "depth = ",
    "overflow = ",
    "1979-05-27T07:32:00Z",
];

#[test]
fn every_pipeline_file_is_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines");
    check("pipelines", files(&folder, |path| path.extension().is_some_and(|end| end == "toml")), |folder| {
        let parse = |text: &str| Pipeline::parse("any.toml", text, &registry([]), &Overrides::default());
        if let Some(pipeline) = answered(parse(&text(folder))) {
            assert!(!pipeline.to_text(TEXT_WIDTH).is_empty());
            let again = parse(&pipeline.to_toml()).unwrap_or_else(|errors| panic!("{}", errors.render(false)));
            assert_eq!(format!("{pipeline:?}"), format!("{again:?}"));
        }
    });
}

#[test]
fn every_file_of_a_golden_case_is_read_or_refused() {
    let mut seeds = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("golden"), Path::is_dir);
    seeds = seeds.iter().filter_map(|stage| files(stage, Path::is_dir).first().cloned()).collect();
    check("golden_cases", seeds.iter().map(|case| case.join("stage.toml")).collect(), |folder| {
        let others = ["inputs", "compare", "expect"];
        answered(SingleStage::parse("stage.toml", &text(folder), &registry([]), &others));
    });
}

fn check(name: &'static str, seeds: Vec<PathBuf>, read: fn(&Path)) {
    let seeds = seeds.iter().filter(|path| path.file_name().is_none_or(|name| name != "Cargo.toml"));
    Target {
        name,
        files: &["any.toml"],
        seeds: seeds.map(|path| Input(vec![fs::read(path).unwrap()])).collect(),
        words: WORDS,
        cases: 1500,
        read,
    }
    .check();
}

/// What lies in a folder, by name.
fn files(folder: &Path, is_wanted: impl Fn(&Path) -> bool) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| is_wanted(path));
    files.sort();
    files
}

fn text(folder: &Path) -> String {
    String::from_utf8_lossy(&fs::read(folder.join("any.toml")).unwrap()).into_owned()
}

/// Errors can be shown, and there is one at least.
fn answered<T>(result: Result<T, PipelineErrors>) -> Option<T> {
    let errors = match result {
        Ok(value) => return Some(value),
        Err(errors) => errors,
    };
    assert!(errors.count() > 0 && !errors.render(true).is_empty() && !errors.render(false).is_empty());
    None
}

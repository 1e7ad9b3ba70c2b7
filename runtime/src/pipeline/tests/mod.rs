//! Tests of pipeline files as a whole.

mod diagrams;
mod errors;
mod overrides;
mod properties;
mod wires;

use super::test_kinds::{VALID, registry};
use super::{Overrides, Pipeline, PipelineErrors};

fn parse(text: &str) -> Result<Pipeline, PipelineErrors> {
    Pipeline::parse("walls.toml", text, &registry(), &Overrides::default())
}

/// The valid pipeline with one text replaced by another.
fn changed(from: &str, to: &str) -> String {
    assert!(VALID.contains(from), "{from} is not in the valid pipeline");
    VALID.replacen(from, to, 1)
}

/// A rendered error.
struct Shown {
    title: String,
    /// `LINE:COLUMN` of its location.
    place: String,
    /// The text underlined with `^`.
    underlined: String,
    /// The whole rendered text.
    text: String,
}

fn shown(errors: &PipelineErrors) -> Vec<Shown> {
    let text = errors.render(false);
    let mut blocks: Vec<&str> = text.split("\n\n").collect();
    assert!(blocks.pop().is_some_and(|last| last.contains("has")));
    assert_eq!(blocks.len(), errors.count(), "{text}");
    blocks.into_iter().map(read_block).collect()
}

fn read_block(block: &str) -> Shown {
    let lines: Vec<&str> = block.lines().collect();
    let place = lines.iter().find_map(|line| line.split_once("--> ")).map_or("", |(_, place)| place);
    let place = place.split_once(':').map_or("", |(_, place)| place);
    let is_marks = |line: &&str| line.contains('^') && line.trim_start().starts_with('|');
    let marks = lines.iter().position(is_marks).unwrap_or_default();
    let under = |(mark, char): (char, char)| (mark == '^').then_some(char);
    let source = lines[marks.saturating_sub(1)].chars();
    Shown {
        title: lines[0].trim_start_matches("error: ").to_owned(),
        place: place.to_owned(),
        underlined: lines[marks].chars().zip(source).filter_map(under).collect(),
        text: block.to_owned(),
    }
}

/// The one error of a pipeline.
fn only_error(text: &str) -> Shown {
    let errors = parse(text).expect_err("the pipeline has an error");
    assert_eq!(errors.count(), 1, "{errors}");
    shown(&errors).remove(0)
}

/// Checks the one error that a change to the valid pipeline causes: its location, the underlined text, and its wording.
#[track_caller]
fn assert_error((from, to): (&str, &str), place: &str, underlined: &str, says: &[&str]) {
    let error = only_error(&changed(from, to));
    assert_eq!((error.place.as_str(), error.underlined.as_str()), (place, underlined), "{}", error.text);
    for text in says {
        assert!(error.text.contains(text), "`{text}` is missing from\n{}", error.text);
    }
}

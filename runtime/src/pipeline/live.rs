//! The settings of live pipelines.

use super::diagnostic::{Diagnostic, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{did_you_mean, quoted_list};
use super::values::{entries, text, wrong_type};
use crate::stage::StageKind;

/// The mode of a run: the order in which stages take their inputs, and the end of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// In order of log time, until the logs end. The same input gives the same output.
    #[default]
    Replay,
    /// In order of arrival, until the user ends the run.
    Live,
}

/// What a live pipeline does with a message for which a reader has granted no credit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overflow {
    /// The sender waits for credit.
    #[default]
    Wait,
    /// The oldest pending message of this reader is dropped, and counted.
    DropOldest,
}

/// What a live pipeline does when a stage fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Restart {
    /// The run ends.
    #[default]
    Never,
    /// The process of the stage is restarted after a delay, and the run continues.
    OnFailure,
}

/// A setting with a fixed set of keywords.
pub(super) trait Keyword: Copy + PartialEq + 'static {
    /// All keywords and their values.
    const KEYWORDS: &'static [(&'static str, Self)];

    /// The keyword of this value.
    fn keyword(self) -> &'static str {
        Self::KEYWORDS.iter().find(|(_, value)| *value == self).map_or("", |(word, _)| word)
    }
}

impl Keyword for Mode {
    const KEYWORDS: &'static [(&'static str, Self)] = &[("replay", Self::Replay), ("live", Self::Live)];
}

impl Keyword for Overflow {
    const KEYWORDS: &'static [(&'static str, Self)] = &[("wait", Self::Wait), ("drop_oldest", Self::DropOldest)];
}

impl Keyword for Restart {
    const KEYWORDS: &'static [(&'static str, Self)] = &[("never", Self::Never), ("on_failure", Self::OnFailure)];
}

/// Reads the keyword that `key` is set to. Reports an error and returns none if it is not valid.
pub(super) fn read_keyword<T: Keyword>(key: &str, item: &Item, problems: &mut Problems) -> Option<T> {
    let word = text(key, item, problems)?;
    let found = T::KEYWORDS.iter().find(|(known, _)| *known == word).map(|(_, value)| *value);
    if found.is_none() {
        let words: Vec<&str> = T::KEYWORDS.iter().map(|(word, _)| *word).collect();
        let problem = Diagnostic::new(format!("wrong value of `{key}`"));
        let label = format!("expected one of {}", quoted_list(&words));
        problems.push(problem.at(&item.at, label).help(did_you_mean(word, words)));
    }
    found
}

/// Reads the overflow settings of the outputs of a stage: `overflow = "KEYWORD"` for all of them, or
/// `overflow = { PORT = "KEYWORD" }`.
pub(super) fn read_overflow(kind: &StageKind, item: Option<&Item>, problems: &mut Problems) -> Vec<Overflow> {
    let mut ports = vec![Overflow::default(); kind.outputs.len()];
    let Some(item) = item else { return ports };
    match &item.value {
        Value::Table(_) => {
            for Entry { key, key_at, item } in entries(item, "overflow", problems) {
                let Some(port) = kind.outputs.iter().position(|output| output.name == key) else {
                    let names: Vec<&str> = kind.outputs.iter().map(|output| output.name).collect();
                    let problem = Diagnostic::new(format!("`{}` has no output `{key}`", kind.name));
                    let label = format!("its outputs: {}", quoted_list(&names));
                    problems.push(problem.at(key_at, label).help(did_you_mean(key, names)));
                    continue;
                };
                ports[port] = read_keyword(key, item, problems).unwrap_or_default();
            }
        }
        _ if item.as_str().is_some() => ports.fill(read_keyword("overflow", item, problems).unwrap_or_default()),
        _ => problems.push(wrong_type("overflow", item, "text in quotes, or a table by output port")),
    }
    ports
}

/// Reports a setting for live pipelines in a replay.
pub(super) fn check_is_live(mode: Mode, entry: Option<&Entry>, problems: &mut Problems) {
    let Some(entry) = entry.filter(|_| mode == Mode::Replay) else { return };
    let problem = Diagnostic::new(format!("`{}` is for live pipelines", entry.key));
    let help = "a replay loses nothing and ends when a stage fails; write `mode = \"live\"` in [pipeline] to run live";
    problems.push(problem.at(&entry.key_at, "this pipeline is a replay").help(help.to_owned()));
}

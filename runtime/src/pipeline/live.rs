//! What a pipeline says of running live.

use super::diagnostic::{Diagnostic, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{did_you_mean, quoted_list};
use super::values::{entries, text, wrong_type};
use crate::stage::StageKind;

/// In which order stages take their inputs, and when a run ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// By log time, to the end of the logs. The same input gives the same output.
    #[default]
    Replay,
    /// As they arrive, until the user ends the run.
    Live,
}

/// What becomes of a message in a live pipeline for which a reader has no room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overflow {
    /// The sender waits until there is room.
    #[default]
    Wait,
    /// The oldest message that waits for this reader is dropped, and counted.
    DropOldest,
}

/// What becomes of a stage of a live pipeline that has failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Restart {
    /// The run ends.
    #[default]
    Never,
    /// Its process is started again after a while, and the run goes on.
    OnFailure,
}

/// A setting that is one of a few words.
pub(super) trait Word: Copy + PartialEq + 'static {
    /// All of them.
    const WORDS: &'static [(&'static str, Self)];

    /// The word for this one.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("", |(word, _)| word)
    }
}

impl Word for Mode {
    const WORDS: &'static [(&'static str, Self)] = &[("replay", Self::Replay), ("live", Self::Live)];
}

impl Word for Overflow {
    const WORDS: &'static [(&'static str, Self)] = &[("wait", Self::Wait), ("drop_oldest", Self::DropOldest)];
}

impl Word for Restart {
    const WORDS: &'static [(&'static str, Self)] = &[("never", Self::Never), ("on_failure", Self::OnFailure)];
}

/// The word that `key` is set to; none, and an error, if it is none of those that it may be.
pub(super) fn read_word<T: Word>(key: &str, item: &Item, problems: &mut Problems) -> Option<T> {
    let word = text(key, item, problems)?;
    let found = T::WORDS.iter().find(|(known, _)| *known == word).map(|(_, value)| *value);
    if found.is_none() {
        let words: Vec<&str> = T::WORDS.iter().map(|(word, _)| *word).collect();
        let problem = Diagnostic::new(format!("wrong value of `{key}`"));
        let label = format!("expected one of {}", quoted_list(&words));
        problems.push(problem.at(&item.at, label).help(did_you_mean(word, words)));
    }
    found
}

/// What the outputs of a stage of `kind` do for which a reader has no room: `overflow = "WORD"` for all of them, or
/// `overflow = { PORT = "WORD" }`.
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
                ports[port] = read_word(key, item, problems).unwrap_or_default();
            }
        }
        _ if item.as_str().is_some() => ports.fill(read_word("overflow", item, problems).unwrap_or_default()),
        _ => problems.push(wrong_type("overflow", item, "text in quotes, or a table by output port")),
    }
    ports
}

/// A setting that only a live pipeline has stands in one that is not live.
pub(super) fn check_is_live(mode: Mode, entry: Option<&Entry>, problems: &mut Problems) {
    let Some(entry) = entry.filter(|_| mode == Mode::Replay) else { return };
    let problem = Diagnostic::new(format!("`{}` is for live pipelines", entry.key));
    let help = "a replay loses nothing and ends when a stage fails; write `mode = \"live\"` in [pipeline] to run live";
    problems.push(problem.at(&entry.key_at, "this pipeline is a replay").help(help.to_owned()));
}

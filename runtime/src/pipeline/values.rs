//! What stands behind the keys of a pipeline file, read as the type that it must have.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{did_you_mean, quoted_list};

/// The entries of a table; an error and no entries if it is none.
pub(super) fn entries<'a>(item: &'a Item, what: &str, problems: &mut Problems) -> &'a [Entry] {
    if let Value::Table(entries) = &item.value {
        return entries;
    }
    let label = format!("expected a table, found {}", item.describe());
    problems.push(Diagnostic::new(format!("`{what}` is not a table")).at(&item.at, label));
    &[]
}

/// The text that `key` is set to; an error if it is none.
pub(super) fn text<'a>(key: &str, item: &'a Item, problems: &mut Problems) -> Option<&'a str> {
    let text = item.as_str();
    if text.is_none() {
        problems.push(wrong_type(key, item, "text in quotes"));
    }
    text
}

/// What `key` is set to is not what it should be.
pub(super) fn wrong_type(key: &str, item: &Item, expected: &str) -> Diagnostic {
    let found = match item.as_integer() {
        Some(number) => format!("`{number}`"),
        None => item.describe().to_owned(),
    };
    Diagnostic::new(format!("wrong value of `{key}`")).at(&item.at, format!("expected {expected}, found {found}"))
}

/// A key that a section does not have.
pub(super) fn unknown_key(key: &str, at: &Location, section: &str, keys: &[&str]) -> Diagnostic {
    let problem = Diagnostic::new(format!("unknown key `{key}` in `{section}`"));
    problem.at(at, format!("expected one of {}", quoted_list(keys))).help(did_you_mean(key, keys.iter().copied()))
}

//! Typed access to the values of a pipeline file.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{did_you_mean, quoted_list};

/// The entries of a table. Reports an error and returns none if the value is not a table.
pub(super) fn entries<'a>(item: &'a Item, what: &str, problems: &mut Problems) -> &'a [Entry] {
    if let Value::Table(entries) = &item.value {
        return entries;
    }
    let label = format!("expected a table, found {}", item.describe());
    problems.push(Diagnostic::new(format!("`{what}` is not a table")).at(&item.at, label));
    &[]
}

/// The string that `key` is set to. Reports an error and returns none if the value is not a string.
pub(super) fn text<'a>(key: &str, item: &'a Item, problems: &mut Problems) -> Option<&'a str> {
    let text = item.as_str();
    if text.is_none() {
        problems.push(wrong_type(key, item, "text in quotes"));
    }
    text
}

/// The error of a value of the wrong type.
pub(super) fn wrong_type(key: &str, item: &Item, expected: &str) -> Diagnostic {
    let found = match item.as_integer() {
        Some(number) => format!("`{number}`"),
        None => item.describe().to_owned(),
    };
    Diagnostic::new(format!("wrong value of `{key}`")).at(&item.at, format!("expected {expected}, found {found}"))
}

/// The error of an unknown key in a section.
pub(super) fn unknown_key(key: &str, at: &Location, section: &str, keys: &[&str]) -> Diagnostic {
    let problem = Diagnostic::new(format!("unknown key `{key}` in `{section}`"));
    problem.at(at, format!("expected one of {}", quoted_list(keys))).help(did_you_mean(key, keys.iter().copied()))
}

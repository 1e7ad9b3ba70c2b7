//! Reading of the parameters of a stage. Each is checked separately, so that all errors are reported.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{nearest, quoted_list};
use super::parameter_schema::{ParameterInfo, parameters_of};
use crate::stage::{ParameterError, RESERVED_KEYS, StageKind};

/// Reads the parameters of a stage of `kind` whose name is at `stage_at`. Wrong ones are reported and omitted.
pub(super) fn read_parameters(
    kind: &StageKind,
    given: &[&Entry],
    stage_at: &Location,
    problems: &mut Problems,
) -> toml::Table {
    let known = parameters_of(kind);
    let closed = kind.parameter_schema().get("additionalProperties") == Some(&serde_json::Value::Bool(false));
    let mut table = toml::Table::new();
    for entry in given {
        let info = known.iter().find(|info| info.name == entry.key);
        if info.is_none() && closed {
            problems.push(unknown_parameter(kind, entry, &known));
            continue;
        }
        let alone = toml::Table::from_iter([(entry.key.clone(), entry.item.to_toml())]);
        match kind.check_parameters(&alone) {
            Ok(_) => table.extend(alone),
            Err(error) => problems.push(wrong_value(kind, entry, info, error.message())),
        }
    }
    match kind.check_parameters(&table) {
        Ok(errors) => {
            for error in errors {
                problems.push(out_of_range(&error, given, stage_at, "is out of range"));
            }
        }
        Err(error) => {
            let title = format!("this combination of parameters of `{}` is invalid", kind.name);
            problems.push(Diagnostic::new(title).at(stage_at, error.message()));
        }
    }
    table
}

/// The diagnostic of an invalid value: `what` is its title, the first line of the error its label, and further lines a
/// note.
pub(super) fn out_of_range(error: &ParameterError, given: &[&Entry], stage_at: &Location, what: &str) -> Diagnostic {
    let title = format!("`{}` {what}", error.field);
    let (problem, more) = error.problem.split_once('\n').unwrap_or((&error.problem, ""));
    // The name of a nested value has dots; its location is that of the table.
    let field = error.field.split('.').next().unwrap_or_default();
    let diagnostic = match given.iter().find(|entry| entry.key == field) {
        Some(entry) => Diagnostic::new(title).at(&entry.item.at, problem),
        None => Diagnostic::new(title).at(stage_at, format!("`{}` {problem}", error.field)),
    };
    if more.is_empty() { diagnostic } else { diagnostic.note(more) }
}

fn unknown_parameter(kind: &StageKind, entry: &Entry, known: &[ParameterInfo]) -> Diagnostic {
    let names: Vec<&str> = known.iter().map(|info| info.name.as_str()).filter(|name| !name.contains('.')).collect();
    let all = names.iter().copied().chain(RESERVED_KEYS);
    let problem = Diagnostic::new(format!("unknown parameter `{}`", entry.key))
        .at(&entry.key_at, format!("`{}` has no such parameter", kind.name));
    match nearest(&entry.key, all) {
        Some(name) => problem.help(format!("did you mean `{name}`?")),
        None if names.is_empty() => problem.note("it has no parameters"),
        None => problem.note(format!("its parameters: {}", quoted_list(&names))),
    }
}

fn wrong_value(kind: &StageKind, entry: &Entry, info: Option<&ParameterInfo>, message: &str) -> Diagnostic {
    let problem = Diagnostic::new(format!("wrong value of `{}`", entry.key));
    let Some(info) = info else { return problem.at(&entry.item.at, message) };
    let expected = info.expected();
    match &entry.item.value {
        Value::Table(_) if info.type_text == "table" => problem.at(&entry.item.at, message),
        Value::List(items) if info.type_text.starts_with("list") => {
            let wrong = items.iter().find(|item| !fits_alone(kind, &entry.key, item));
            match wrong.filter(|_| fits_empty(kind, &entry.key)) {
                Some(item) => problem.at(&item.at, format!("expected {expected}, and this is {}", item.describe())),
                None => problem.at(&entry.item.at, format!("expected {expected}")).note(message),
            }
        }
        _ => {
            let text = entry.item.as_str();
            let found = match (text, entry.item.as_integer()) {
                (Some(text), _) if !info.values.is_empty() => format!("\"{text}\""),
                (_, Some(number)) => format!("`{number}`"),
                _ => entry.item.describe().to_owned(),
            };
            let near = text.and_then(|text| nearest(text, info.values.iter().map(|(value, _)| value.as_str())));
            let problem = problem.at(&entry.item.at, format!("expected {expected}, found {found}"));
            let problem = problem.help(near.map(|value| format!("did you mean \"{value}\"?")));
            // An integer that the schema allows, but the type does not, is too large.
            let too_large = entry.item.as_integer().is_some_and(|number| number > i64::from(u8::MAX));
            if too_large { problem.note(message) } else { problem }
        }
    }
}

fn fits_alone(kind: &StageKind, key: &str, item: &Item) -> bool {
    let list = toml::Value::Array(vec![item.to_toml()]);
    kind.check_parameters(&toml::Table::from_iter([(key.to_owned(), list)])).is_ok()
}

fn fits_empty(kind: &StageKind, key: &str) -> bool {
    kind.check_parameters(&toml::Table::from_iter([(key.to_owned(), toml::Value::Array(Vec::new()))])).is_ok()
}

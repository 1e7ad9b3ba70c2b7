//! The sections `[stages.NAME]`, before they are wired.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::live::{Mode, Overflow, Restart, check_is_live, read_keyword, read_overflow};
use super::nearest::suggest;
use super::parameters::{out_of_range, read_parameters};
use super::settings::{Settings, depth};
use super::topics::{Topic, read_topics};
use super::values::text;
use crate::stage::{RESERVED_KEYS, Registry, ResolvedStage, StageKind};
use std::path::Path;

/// The maximum length of a stage's name, bytes. It is part of the names of topics and links.
const LONGEST_NAME: usize = 64;

/// A stage whose inputs are not wired yet.
#[derive(Debug)]
pub(super) struct Draft<'a> {
    /// Its name.
    pub(super) name: &'a str,
    /// The location of its name.
    pub(super) at: &'a Location,
    /// Its kind; none after an error, which has been reported.
    pub(super) kind: Option<&'a StageKind>,
    pub(super) parameters: toml::Table,
    /// The value of `inputs`.
    pub(super) inputs: Option<&'a Item>,
    /// The topic of each output port of the kind.
    pub(super) topics: Vec<Topic>,
    pub(super) depth: usize,
    /// The process that it runs in.
    pub(super) process: &'a str,
    /// The overflow setting of each output port of the kind.
    pub(super) overflow: Vec<Overflow>,
    pub(super) restart: Restart,
}

/// Reads a stage of a pipeline with the given settings, whose file is in `folder`.
pub(super) fn read_stage<'a>(
    stage: &'a Entry,
    settings: &Settings,
    folder: &Path,
    registry: &'a Registry,
    problems: &mut Problems,
) -> Draft<'a> {
    check_name("stage", &stage.key, &stage.key_at, problems);
    let mut draft = Draft {
        name: &stage.key,
        at: &stage.key_at,
        kind: None,
        parameters: toml::Table::new(),
        inputs: None,
        topics: Vec::new(),
        depth: settings.depth,
        process: &stage.key,
        overflow: Vec::new(),
        restart: Restart::default(),
    };
    let Value::Table(entries) = &stage.item.value else {
        let label = format!("expected a table, found {}", stage.item.describe());
        let problem = Diagnostic::new(format!("the stage `{}` is not a table", stage.key)).at(&stage.item.at, label);
        problems.push(problem.help(format!("write a section `[stages.{}]` with `kind = \"...\"`", stage.key)));
        return draft;
    };
    let find = |key: &str| entries.iter().find(|entry| entry.key == key);
    let given: Vec<&Entry> = entries.iter().filter(|entry| !RESERVED_KEYS.contains(&entry.key.as_str())).collect();
    draft.kind = read_kind(stage, find("kind"), registry, problems);
    let resolved =
        draft.kind.filter(|kind| kind.is_dynamic()).and_then(|kind| resolve(stage, kind, &given, folder, problems));
    if draft.kind.is_some_and(StageKind::is_dynamic) {
        draft.kind = resolved.as_ref().map(|resolved| resolved.kind);
    }
    draft.inputs = find("inputs").map(|entry| &entry.item);
    draft.depth = find("depth").and_then(|entry| depth(&entry.item, problems)).unwrap_or(settings.depth);
    if let Some(entry) = find("process")
        && let Some(process) = text("process", &entry.item, problems)
    {
        check_name("process", process, &entry.item.at, problems);
        draft.process = process;
    }
    for key in ["overflow", "restart"] {
        check_is_live(settings.mode, find(key), problems);
    }
    draft.restart =
        find("restart").and_then(|entry| read_keyword("restart", &entry.item, problems)).unwrap_or_default();
    if let Some(kind) = draft.kind {
        check_mode(stage, kind, settings.mode, problems);
        draft.overflow = read_overflow(kind, find("overflow").map(|entry| &entry.item), problems);
        draft.parameters = read_parameters(kind, &given, &stage.key_at, problems);
        draft.parameters.extend(resolved.map(|resolved| resolved.parameters).unwrap_or_default());
        draft.topics = read_topics(stage, kind, find("topics").map(|entry| &entry.item), problems);
    }
    draft
}

/// Resolves a stage of a dynamic kind. Errors are reported.
fn resolve(
    stage: &Entry,
    kind: &StageKind,
    given: &[&Entry],
    folder: &Path,
    problems: &mut Problems,
) -> Option<ResolvedStage> {
    let table = given.iter().map(|entry| (entry.key.clone(), entry.item.to_toml())).collect();
    let resolved = kind.resolve(&table, folder)?;
    resolved.map_err(|error| problems.push(out_of_range(&error, given, &stage.key_at, "cannot be used"))).ok()
}

/// Reports a kind for live pipelines in a replay.
fn check_mode(stage: &Entry, kind: &StageKind, mode: Mode, problems: &mut Problems) {
    if kind.is_live_only() && mode == Mode::Replay {
        let problem = Diagnostic::new(format!("`{}` is for live pipelines", kind.name));
        let help = "read logs with a `mcap_source`, or write `mode = \"live\"` in [pipeline] to run live";
        problems.push(problem.at(&stage.key_at, "this pipeline is a replay").help(help.to_owned()));
    }
}

fn check_name(what: &str, name: &str, at: &Location, problems: &mut Problems) {
    let allowed = |char: char| char.is_ascii_lowercase() || char.is_ascii_digit() || char == '_' || char == '-';
    let problem = Diagnostic::new(format!("`{name}` is not a valid name for a {what}"));
    if name.len() > LONGEST_NAME {
        let label = format!("expected at most {LONGEST_NAME} characters, found {}", name.len());
        problems.push(Diagnostic::new(format!("the name of this {what} is too long")).at(at, label));
    } else if name.is_empty() || name.starts_with('-') || !name.chars().all(allowed) {
        problems.push(problem.at(at, "expected lower-case letters a-z, digits, `_` and, but for the first, `-`"));
    }
}

fn read_kind<'a>(
    stage: &Entry,
    kind: Option<&Entry>,
    registry: &'a Registry,
    problems: &mut Problems,
) -> Option<&'a StageKind> {
    let names: Vec<&str> = registry.kinds().map(|kind| kind.name).collect();
    let Some(entry) = kind else {
        let problem = Diagnostic::new(format!("the stage `{}` has no kind", stage.key))
            .at(&stage.key_at, "expected `kind = \"...\"`");
        problems.push(problem.help(suggest(&stage.key, &names, "there are")));
        return None;
    };
    let name = text("kind", &entry.item, problems)?;
    let found = registry.get(name);
    if found.is_none() {
        let problem =
            Diagnostic::new(format!("unknown kind of stage `{name}`")).at(&entry.item.at, "there is no such kind");
        problems.push(problem.help(suggest(name, &names, "there are")));
    }
    found
}

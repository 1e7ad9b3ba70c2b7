//! Resolution of an entry of `inputs`: `STAGE.PORT`, `STAGE` or `STAGE.*`.

use super::diagnostic::{Diagnostic, Location};
use super::nearest::{nearest, quoted_list, suggest};
use super::stage_section::Draft;
use crate::stage::{OutputPort, PortType};

/// An output of a stage, by the indexes of the stage and of its port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Output {
    pub(super) stage: usize,
    pub(super) port: usize,
}

impl Output {
    /// Its name, `STAGE.PORT`.
    pub(super) fn name(self, drafts: &[Draft<'_>]) -> String {
        let stage = drafts.get(self.stage).map_or("", |draft| draft.name);
        format!("{stage}.{}", self.declaration(drafts).map_or("", |port| port.name))
    }

    pub(super) fn port_type(self, drafts: &[Draft<'_>]) -> PortType {
        self.declaration(drafts).map_or(PortType::Any, |port| port.port_type)
    }

    fn declaration<'a>(self, drafts: &[Draft<'a>]) -> Option<&'a OutputPort> {
        drafts.get(self.stage)?.kind?.outputs.get(self.port)
    }
}

/// The outputs that an entry refers to.
#[derive(Debug, Default)]
pub(super) struct Resolved {
    /// The stage of the entry, or the one that was probably meant.
    pub(super) stage: Option<usize>,
    /// Whether there is no stage of that name, so that the stage is a guess.
    pub(super) guessed: bool,
    /// The outputs; none after an error.
    pub(super) outputs: Vec<Output>,
    /// Whether the entry refers to all outputs of the stage.
    pub(super) all: bool,
    /// The error, unless it has been reported for the stage itself.
    pub(super) problem: Option<Diagnostic>,
}

/// Resolves the entry `text` at `at` in the inputs of stage `reader`.
pub(super) fn resolve(text: &str, at: &Location, reader: usize, drafts: &[Draft<'_>]) -> Resolved {
    let (name, port) = match text.split_once('.') {
        Some((name, port)) => (name, Some(port)),
        None => (text, None),
    };
    let name_at = at.part(text, 0..name.len());
    let Some(stage) = drafts.iter().position(|draft| draft.name == name) else {
        return unknown_stage(name, port, &name_at, reader, drafts);
    };
    let mut resolved = Resolved { stage: Some(stage), ..Resolved::default() };
    if stage == reader {
        let problem = Diagnostic::new(format!("the stage `{name}` is wired to itself"));
        resolved.problem = Some(problem.at(at, "a stage cannot read its own output"));
        return resolved;
    }
    let Some(kind) = drafts[stage].kind else { return resolved };
    let output = |port| Output { stage, port };
    let all = || (0..kind.outputs.len()).map(output).collect::<Vec<_>>();
    let names: Vec<String> = all().into_iter().map(|output| output.name(drafts)).collect();
    let several = format!("{}, or `{name}.*` for all where an input takes many", quoted_list(&names));
    let main: Vec<Output> = all().into_iter().filter(|output| !kind.outputs[output.port].side).collect();
    if port.is_none() && main.len() == 1 {
        resolved.outputs = main;
        return resolved;
    }
    let problem = match (port, kind.outputs.as_slice()) {
        (_, []) => Diagnostic::new(format!("`{name}` has no outputs")).at(at, format!("it is a `{}`", kind.name)),
        (None, outputs) => Diagnostic::new(format!("it is ambiguous which output of `{name}` is meant"))
            .at(at, format!("`{}` has {} outputs", kind.name, outputs.len()))
            .help(format!("name one: {several}")),
        (Some("*"), _) => {
            (resolved.outputs, resolved.all) = (all(), true);
            return resolved;
        }
        (Some(port), outputs) => {
            if let Some(found) = outputs.iter().position(|output| output.name == port) {
                resolved.outputs = vec![output(found)];
                return resolved;
            }
            let ports: Vec<&str> = outputs.iter().map(|output| output.name).collect();
            let port_at = at.part(text, name.len() + 1..text.len());
            Diagnostic::new(format!("`{name}` has no output `{port}`"))
                .at(&port_at, format!("`{}` has no such output", kind.name))
                .help(suggest(port, &ports, "its outputs"))
        }
    };
    resolved.problem = Some(problem);
    resolved
}

fn unknown_stage(name: &str, port: Option<&str>, at: &Location, reader: usize, drafts: &[Draft<'_>]) -> Resolved {
    let names: Vec<&str> =
        drafts.iter().enumerate().filter(|&(stage, _)| stage != reader).map(|(_, draft)| draft.name).collect();
    let meant = nearest(name, names.iter().copied());
    let stage = meant.and_then(|meant| drafts.iter().position(|draft| draft.name == meant));
    let help = match (meant, port) {
        (Some(meant), Some(port)) => Some(format!("did you mean `{meant}.{port}`?")),
        _ => suggest(name, &names, "the other stages"),
    };
    let problem = Diagnostic::new(format!("unknown stage `{name}`")).at(at, "there is no such stage").help(help);
    Resolved { stage, guessed: true, problem: Some(problem), ..Resolved::default() }
}

/// The names of the outputs of other stages with the given type.
pub(super) fn outputs_of_type(port_type: PortType, reader: usize, drafts: &[Draft<'_>]) -> Vec<String> {
    let mut names = Vec::new();
    for (stage, draft) in drafts.iter().enumerate().filter(|&(stage, _)| stage != reader) {
        let outputs = draft.kind.map(|kind| kind.outputs.as_slice()).unwrap_or_default();
        let fitting = outputs.iter().enumerate();
        let fitting = fitting.filter(|(_, output)| port_type == PortType::Any || output.port_type == port_type);
        names.extend(fitting.map(|(port, _)| Output { stage, port }.name(drafts)));
    }
    names
}

/// A type in words.
pub(super) fn type_text(port_type: PortType) -> String {
    match port_type {
        PortType::Any => "any type".to_owned(),
        PortType::Ros(name) => name.to_owned(),
    }
}

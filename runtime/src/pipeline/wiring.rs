//! Which output feeds which input.

use super::binding::Binder;
use super::diagnostic::{Diagnostic, Location, Problems};
use super::reference::Output;
use super::stage_section::Draft;
use crate::stage::Registry;
use std::collections::BTreeSet;

/// What feeds an input port, and where the file says so.
#[derive(Clone, Debug)]
pub(super) struct Input {
    pub(super) port: usize,
    pub(super) from: Output,
    pub(super) at: Location,
}

/// One stage names another in its inputs, whether or not that can be wired.
#[derive(Clone, Debug)]
pub(super) struct Mention {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) at: Location,
    /// Whether the name is wrong, and this is what was probably meant.
    pub(super) guessed: bool,
}

/// The wires of a pipeline.
#[derive(Debug, Default)]
pub(super) struct Wiring {
    /// For every stage its inputs, by port and then in the order of the file.
    pub(super) inputs: Vec<Vec<Input>>,
    /// All that is named.
    pub(super) mentions: Vec<Mention>,
}

impl Wiring {
    /// Wires all stages.
    pub(super) fn new(drafts: &[Draft<'_>], registry: &Registry, problems: &mut Problems) -> Self {
        let mut wiring = Self::default();
        for (stage, draft) in drafts.iter().enumerate() {
            let mut binder = Binder::new(drafts, stage, &mut wiring.mentions, problems);
            if let Some(inputs) = draft.inputs {
                binder.read(inputs);
            }
            let inputs = binder.finish(registry);
            wiring.inputs.push(inputs);
        }
        wiring
    }

    /// Whether an output feeds an input.
    pub(super) fn is_read(&self, stage: usize, port: usize) -> bool {
        self.inputs.iter().flatten().any(|input| input.from == Output { stage, port })
    }
}

/// A stage that has outputs of which none is read works for nothing: a wire was forgotten.
pub(super) fn check_used(drafts: &[Draft<'_>], wiring: &Wiring, problems: &mut Problems) {
    let used: BTreeSet<usize> = wiring.mentions.iter().map(|mention| mention.from).collect();
    for (stage, draft) in drafts.iter().enumerate() {
        let outputs = draft.kind.map(|kind| kind.outputs.as_slice()).unwrap_or_default();
        let Some(first) = outputs.first() else { continue };
        if used.contains(&stage) {
            continue;
        }
        let title = match outputs.len() {
            1 => format!("the output of `{}` is not used", draft.name),
            _ => format!("no output of `{}` is used", draft.name),
        };
        let name = if outputs.len() == 1 { draft.name.to_owned() } else { format!("{}.{}", draft.name, first.name) };
        let problem = Diagnostic::new(title).at(draft.at, "no stage names it in its inputs");
        problems.push(problem.help(format!("add \"{name}\" to the inputs of another stage, or take this stage out")));
    }
}

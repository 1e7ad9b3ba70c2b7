//! The wires from outputs to inputs.

use super::binding::{Binder, Input, Mention};
use super::diagnostic::{Diagnostic, Problems};
use super::reference::Output;
use super::stage_section::Draft;
use super::topics::Topic;
use crate::stage::Registry;
use std::collections::{BTreeMap, BTreeSet};

/// The most readers of an output. What its link reserves grows with their square.
const MOST_READERS: usize = 64;

/// The wires of a pipeline.
#[derive(Debug, Default)]
pub(super) struct Wiring {
    /// The inputs of each stage, by port and then in the order of the file.
    pub(super) inputs: Vec<Vec<Input>>,
    /// All references of stages to others.
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
    fn is_read(&self, stage: usize, port: usize) -> bool {
        self.inputs.iter().flatten().any(|input| input.from == Output { stage, port })
    }
}

/// Reports outputs with so many readers that the memory that their links reserve would be out of proportion.
pub(super) fn check_readers(drafts: &[Draft<'_>], wiring: &Wiring, problems: &mut Problems) {
    let mut readers: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for input in wiring.inputs.iter().flatten() {
        *readers.entry((input.from.stage, input.from.port)).or_default() += 1;
    }
    for ((stage, port), count) in readers.into_iter().filter(|(_, count)| *count > MOST_READERS) {
        let Some(draft) = drafts.get(stage) else { continue };
        let output = draft.kind.and_then(|kind| kind.outputs.get(port)).map_or("", |output| output.name);
        let title = format!("`{}.{output}` has {count} readers, and an output may have {MOST_READERS}", draft.name);
        problems.push(Diagnostic::new(title).at(draft.at, "too many stages have it as an input"));
    }
}

/// Reports stages whose outputs are all unread: probably a wire was forgotten.
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
        let problem = Diagnostic::new(title).at(draft.at, "no stage has it as an input");
        problems.push(problem.help(format!("add \"{name}\" to the inputs of another stage, or remove this stage")));
    }
}

/// Reports outputs with the same topic, whose messages would be mixed in a log.
pub(super) fn check_topics_differ(drafts: &[Draft<'_>], wiring: &Wiring, problems: &mut Problems) {
    let mut first: BTreeMap<&str, (&Draft<'_>, &str, &Topic)> = BTreeMap::new();
    for (stage, draft) in drafts.iter().enumerate() {
        let ports = draft.kind.map(|kind| kind.outputs.as_slice()).unwrap_or_default();
        for (port, (topic, output)) in draft.topics.iter().zip(ports).enumerate() {
            if !wiring.is_read(stage, port) {
                continue;
            }
            let Some((other, other_port, other_topic)) = first.get(topic.template.as_str()) else {
                first.insert(&topic.template, (draft, output.name, topic));
                continue;
            };
            let (name, port, template) = (draft.name, output.name, topic.template.as_str());
            let other_name = other.name;
            let problem =
                Diagnostic::new(format!("`{other_name}.{other_port}` and `{name}.{port}` have the same topic")).at(
                    &topic.at,
                    format!("`{name}.{port}` goes to `{template}`, where its messages would mix with the other's"),
                );
            let problem = match topic.at == other_topic.at {
                true => problem,
                false => problem.context(&other_topic.at, format!("`{other_name}.{other_port}` goes there too")),
            };
            let own = format!("/{name}/{port}");
            problems.push(problem.help(format!("give one another topic: `topics = {{ {port} = \"{own}\" }}`")));
        }
    }
}

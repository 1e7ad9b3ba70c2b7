//! Assignment of outputs to the input ports of a stage.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item, Value};
use super::nearest::{quoted_list, suggest};
use super::reference::{Output, Resolved, outputs_of_type, resolve, type_text};
use super::stage_section::Draft;
use super::values::{text, wrong_type};
use crate::stage::{InputPort, PortType, Registry, StageKind};

/// The output that feeds an input port, and its location in the file.
#[derive(Clone, Debug)]
pub(super) struct Input {
    pub(super) port: usize,
    pub(super) from: Output,
    pub(super) at: Location,
}

/// A reference of a stage to another in its inputs, whether or not it can be wired.
#[derive(Clone, Debug)]
pub(super) struct Mention {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) at: Location,
    /// Whether the name is wrong, and `from` is the stage that was probably meant.
    pub(super) guessed: bool,
}

/// Assigns the inputs of one stage.
pub(super) struct Binder<'a> {
    drafts: &'a [Draft<'a>],
    stage: usize,
    inputs: Vec<Input>,
    /// The ports of the entries that could not be wired, if the file names them.
    failed: Vec<Option<usize>>,
    mentions: &'a mut Vec<Mention>,
    problems: &'a mut Problems,
}

impl<'a> Binder<'a> {
    /// A binder for the stage with the given index. All its references are added to `mentions`.
    pub(super) fn new(
        drafts: &'a [Draft<'a>],
        stage: usize,
        mentions: &'a mut Vec<Mention>,
        problems: &'a mut Problems,
    ) -> Self {
        Self { drafts, stage, inputs: Vec::new(), failed: Vec::new(), mentions, problems }
    }

    /// Returns the wires, by port and then in the order of the file, and reports missing ones.
    pub(super) fn finish(mut self, registry: &Registry) -> Vec<Input> {
        if let Some(kind) = self.drafts[self.stage].kind {
            self.check_missing(kind, registry);
        }
        self.inputs.sort_by_key(|input| input.port);
        self.inputs
    }

    /// The stage's name and its input ports; none if its kind is unknown.
    fn reader(&self) -> (&str, &[InputPort]) {
        let draft = &self.drafts[self.stage];
        (draft.name, draft.kind.map(|kind| kind.inputs.as_slice()).unwrap_or_default())
    }

    /// Reads the value of `inputs`.
    pub(super) fn read(&mut self, inputs: &Item) {
        if let Some(kind) = self.drafts[self.stage].kind
            && kind.inputs.is_empty()
        {
            let label = format!("`{}` takes no inputs", kind.name);
            self.problems.push(Diagnostic::new("a source has no inputs").at(&inputs.at, label));
            return;
        }
        match &inputs.value {
            Value::List(items) => items.iter().for_each(|item| self.read_entry(item, None)),
            Value::Table(entries) => entries.iter().for_each(|entry| self.read_port(entry)),
            Value::Plain(_) => {
                let problem = wrong_type("inputs", inputs, "a list of outputs or a table of ports");
                let example = inputs.as_str().unwrap_or("STAGE.PORT");
                self.problems.push(problem.help(format!("write `inputs = [\"{example}\"]`")));
                self.mention(&resolve(example, &inputs.at, self.stage, self.drafts), &inputs.at);
                self.failed.resize(self.reader().1.len(), None);
            }
        }
    }

    /// `PORT = "STAGE.PORT"` or `PORT = ["STAGE.PORT", ...]`.
    fn read_port(&mut self, Entry { key, key_at, item }: &Entry) {
        let (_, ports) = self.reader();
        let port = ports.iter().position(|port| port.name == key);
        if let (None, Some(kind)) = (port, self.drafts[self.stage].kind) {
            let names: Vec<&str> = ports.iter().map(|port| port.name).collect();
            let problem = Diagnostic::new(format!("unknown input `{key}`"))
                .at(key_at, format!("`{}` has no such input", kind.name))
                .help(suggest(key, &names, "its inputs"));
            self.problems.push(problem);
            self.failed.push(None);
            return;
        }
        match &item.value {
            Value::List(items) => items.iter().for_each(|item| self.read_entry(item, port)),
            _ => self.read_entry(item, port),
        }
    }

    /// Reads one entry, for the given port or for the first that fits.
    fn read_entry(&mut self, item: &Item, port: Option<usize>) {
        // To look for the name that was meant takes longer the more stages there are.
        if self.problems.is_full() {
            self.failed.push(port);
            return;
        }
        let Some(text) = text("inputs", item, self.problems) else {
            self.failed.push(port);
            return;
        };
        let resolved = resolve(text, &item.at, self.stage, self.drafts);
        let before = self.inputs.len();
        self.mention(&resolved, &item.at);
        if let Some(problem) = resolved.problem {
            self.problems.push(problem);
        } else if self.drafts[self.stage].kind.is_some() {
            for &output in &resolved.outputs {
                if let Err(problem) = self.bind(output, resolved.all, port, &item.at) {
                    self.problems.push(problem);
                    break;
                }
            }
        }
        if self.inputs.len() == before {
            self.failed.push(port);
        }
    }

    fn mention(&mut self, resolved: &Resolved, at: &Location) {
        if let Some(from) = resolved.stage.filter(|&from| from != self.stage) {
            self.mentions.push(Mention { from, to: self.stage, at: at.clone(), guessed: resolved.guessed });
        }
    }

    /// Wires one output to the given port, or to the first that fits.
    fn bind(&mut self, from: Output, all: bool, port: Option<usize>, at: &Location) -> Result<(), Diagnostic> {
        let name = from.name(self.drafts);
        let given = self.inputs.iter().find(|input| input.from == from && port.is_none_or(|port| input.port == port));
        if let Some(first) = given {
            let problem = Diagnostic::new(format!("`{name}` is given twice")).at(at, "the second time");
            return Err(problem.context(&first.at, "the first time"));
        }
        let port_type = from.port_type(self.drafts);
        let port = match port {
            Some(port) => port,
            None => self.choose(port_type, all).ok_or_else(|| self.no_port(from, all, at))?,
        };
        let Some(declaration) = self.reader().1.get(port) else { return Ok(()) };
        if !accepts(declaration, port_type) {
            return Err(self.wrong_port(from, port, at));
        }
        let ros_type = port_type.name();
        if declaration.port_type == port_type && self.is_defined_differently(from, ros_type) {
            let reader = self.reader().0;
            let label = format!("its type is {ros_type}, which `{reader}` defines differently");
            let problem =
                Diagnostic::new(format!("`{name}` and `{reader}` have two types of the same name")).at(at, label);
            return Err(problem.help("let both import the definition from one module".to_owned()));
        }
        if !self.has_capacity(port, all) {
            return Err(self.too_many(from, all, port, at));
        }
        self.inputs.push(Input { port, from, at: at.clone() });
        Ok(())
    }

    /// Whether the stage of an output and the reader define a type differently.
    fn is_defined_differently(&self, from: Output, ros_type: &str) -> bool {
        let definition = |stage: usize| self.drafts.get(stage)?.kind?.definition(ros_type);
        let (given, taken) = (definition(from.stage), definition(self.stage));
        given.is_some() && taken.is_some() && given != taken
    }

    /// The first port with capacity of exactly this type or, if there is none, of any type.
    fn choose(&self, port_type: PortType, all: bool) -> Option<usize> {
        let (_, ports) = self.reader();
        let free = || (0..ports.len()).filter(|&port| self.has_capacity(port, all));
        let of_type = |wanted| free().find(|&port| ports[port].port_type == wanted);
        of_type(port_type).or_else(|| of_type(PortType::Any))
    }

    /// Whether a port accepts another output, or with `all` any number of outputs.
    fn has_capacity(&self, port: usize, all: bool) -> bool {
        let many = self.reader().1.get(port).is_some_and(|port| port.many);
        many || (!all && self.inputs.iter().all(|input| input.port != port))
    }

    /// The error of an output that fits no port with capacity.
    fn no_port(&self, from: Output, all: bool, at: &Location) -> Diagnostic {
        let (reader, ports) = self.reader();
        let port_type = from.port_type(self.drafts);
        if let Some(port) = ports.iter().position(|port| accepts(port, port_type)) {
            return self.too_many(from, all, port, at);
        }
        if ports.len() == 1 {
            return self.wrong_port(from, 0, at);
        }
        let inputs = ports.iter().map(|port| format!("`{}` takes {}", port.name, type_text(port.port_type)));
        Diagnostic::new(format!("`{}` fits no input of `{reader}`", from.name(self.drafts)))
            .at(at, format!("its type is {}", type_text(port_type)))
            .note(format!("its inputs: {}", inputs.collect::<Vec<_>>().join(", ")))
    }

    /// The error of an output whose type does not match the port.
    fn wrong_port(&self, from: Output, port: usize, at: &Location) -> Diagnostic {
        let (reader, ports) = self.reader();
        let (name, expected) = ports.get(port).map_or(("", PortType::Any), |port| (port.name, port.port_type));
        let (expected, found) = (type_text(expected), type_text(from.port_type(self.drafts)));
        Diagnostic::new(format!("`{}` does not fit the input `{name}` of `{reader}`", from.name(self.drafts)))
            .at(at, format!("expected {expected}, found {found}"))
            .help(self.suggest_feeders(port))
    }

    /// The error of a second output for a port that takes one.
    fn too_many(&self, from: Output, all: bool, port: usize, at: &Location) -> Diagnostic {
        let (reader, ports) = self.reader();
        let name = ports.get(port).map_or("", |port| port.name);
        let problem = Diagnostic::new(format!("the input `{name}` of `{reader}` takes one output"));
        if all {
            return problem.at(at, "`*` means all outputs of a stage").help(self.suggest_feeders(port));
        }
        let problem = problem.at(at, format!("`{}` is one too many", from.name(self.drafts)));
        let first = self.inputs.iter().find(|input| input.port == port);
        first.into_iter().fold(problem, |problem, first| {
            problem.context(&first.at, format!("`{name}` is fed by `{}`", first.from.name(self.drafts)))
        })
    }

    /// Reports every required input that is not wired, except for entries that were reported already.
    fn check_missing(&mut self, kind: &StageKind, registry: &Registry) {
        let mut excused = self.failed.iter().filter(|port| port.is_none()).count();
        for (index, port) in kind.inputs.iter().enumerate() {
            let wired = self.inputs.iter().any(|input| input.port == index);
            if port.optional || wired || self.failed.contains(&Some(index)) {
                continue;
            }
            if excused > 0 {
                excused -= 1;
                continue;
            }
            let draft = &self.drafts[self.stage];
            let at = draft.inputs.map_or(draft.at, |inputs| &inputs.at);
            let label = format!("expected an output of type {} for it", type_text(port.port_type));
            let title = format!("the input `{}` of `{}` is not wired", port.name, draft.name);
            let help = self.suggest_feeders(index).or_else(|| {
                let gives = |kind: &&StageKind| kind.outputs.iter().any(|output| output.port_type == port.port_type);
                let kinds: Vec<&str> = registry.kinds().filter(gives).map(|kind| kind.name).collect();
                let list = quoted_list(&kinds);
                (!kinds.is_empty()).then(|| format!("no stage here has such an output; add one of kind {list}"))
            });
            self.problems.push(Diagnostic::new(title).at(at, label).help(help));
        }
    }

    /// The help that lists the outputs of the pipeline that could feed an input port.
    fn suggest_feeders(&self, port: usize) -> Option<String> {
        let port = self.reader().1.get(port)?;
        let names = outputs_of_type(port.port_type, self.stage, self.drafts);
        (!names.is_empty()).then(|| format!("`{}` could be fed by {}", port.name, quoted_list(&names)))
    }
}

pub(super) fn accepts(port: &InputPort, port_type: PortType) -> bool {
    port.port_type == port_type || port.port_type == PortType::Any
}

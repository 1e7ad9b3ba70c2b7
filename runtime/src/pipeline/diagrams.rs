//! Pipelines as text and as diagrams.

use super::kinds::toml_text;
use super::parameter_schema::parameters_of;
use super::reference::type_text;
use super::text_layout::{push_filled, push_table};
use super::{Pipeline, StageSpec, Wire};
use serde_json::Value;

impl Pipeline {
    /// A list of the stages in order: kind, inputs, and parameters that differ from their defaults. Lines are wrapped
    /// at `width` characters where possible.
    pub fn to_text(&self, width: usize) -> String {
        let count = match self.stages.len() {
            1 => "1 stage".to_owned(),
            count => format!("{count} stages"),
        };
        let reference = self.reference.as_deref().unwrap_or("the first robot by name");
        let mut page = format!("{}: {count}, seed {}, reference {reference}\n", self.name, self.seed);
        for (index, stage) in self.stages.iter().enumerate() {
            page.push_str(&format!("\n{}. {} ({})\n", index + 1, stage.name, stage.kind.name));
            let inputs: Vec<[String; 3]> = stage
                .inputs
                .iter()
                .map(|wire| {
                    let port = stage.kind.inputs[wire.port].name;
                    [port.to_owned(), format!("<- {}", self.output_name(wire)), self.wire_type(wire)]
                })
                .collect();
            push_table(&mut page, 5, width, &inputs);
            let parameters: Vec<[String; 1]> = changed_parameters(stage).map(|line| [line]).collect();
            push_table(&mut page, 5, width, &parameters);
            let unread = self.unread_outputs(index);
            if !unread.is_empty() {
                push_filled(&mut page, 5, width, &format!("not read: {}", unread.join(", ")));
            }
        }
        page
    }

    /// A Mermaid flowchart.
    pub fn to_mermaid(&self) -> String {
        let mut page = "flowchart LR\n".to_owned();
        for (index, stage) in self.stages.iter().enumerate() {
            page.push_str(&format!("    s{index}[\"<b>{}</b><br/>{}\"]\n", stage.name, stage.kind.name));
        }
        for (to, wire) in self.wires() {
            let label = format!("{}<br/>{}", self.output_port(wire), self.wire_type(wire));
            page.push_str(&format!("    s{} -->|\"{label}\"| s{to}\n", wire.from_stage));
        }
        page
    }

    /// A digraph in the language of Graphviz.
    pub fn to_dot(&self) -> String {
        // The name may be that of a file, so it must be escaped.
        let name = self.name.replace('\\', "\\\\").replace('"', "\\\"");
        let mut page = format!("digraph \"{name}\" {{\n    rankdir=LR;\n    node [shape=box];\n");
        for stage in &self.stages {
            page.push_str(&format!("    \"{}\" [label=\"{}\\n{}\"];\n", stage.name, stage.name, stage.kind.name));
        }
        for (to, wire) in self.wires() {
            let from = &self.stages[wire.from_stage].name;
            let label = format!("{}\\n{}", self.output_port(wire), self.wire_type(wire));
            page.push_str(&format!("    \"{from}\" -> \"{}\" [label=\"{label}\"];\n", self.stages[to].name));
        }
        page.push_str("}\n");
        page
    }

    /// All wires, each with the index of the reading stage.
    fn wires(&self) -> impl Iterator<Item = (usize, &Wire)> {
        self.stages.iter().enumerate().flat_map(|(index, stage)| stage.inputs.iter().map(move |wire| (index, wire)))
    }

    fn output_port(&self, wire: &Wire) -> &'static str {
        self.stages[wire.from_stage].kind.outputs[wire.from_port].name
    }

    fn output_name(&self, wire: &Wire) -> String {
        format!("{}.{}", self.stages[wire.from_stage].name, self.output_port(wire))
    }

    fn wire_type(&self, wire: &Wire) -> String {
        type_text(self.stages[wire.from_stage].kind.outputs[wire.from_port].port_type)
    }

    fn unread_outputs(&self, stage: usize) -> Vec<&'static str> {
        let is_read = |port| self.wires().any(|(_, wire)| wire.from_stage == stage && wire.from_port == port);
        let outputs = self.stages[stage].kind.outputs.iter().enumerate();
        outputs.filter(|(port, _)| !is_read(*port)).map(|(_, output)| output.name).collect()
    }
}

/// The given parameters that differ from their defaults, as in the pipeline file.
fn changed_parameters(stage: &StageSpec) -> impl Iterator<Item = String> {
    let known = parameters_of(&stage.kind);
    stage.parameters.iter().filter_map(move |(name, value)| {
        let value = serde_json::to_value(value).unwrap_or_default();
        let default = known.iter().find(|info| info.name == *name).and_then(|info| info.default.as_ref());
        let same = default.is_some_and(|default| same_value(default, &value));
        (!same).then(|| format!("{name} = {}", toml_text(&value)))
    })
}

/// Whether two values are equal; an integer can equal a float.
fn same_value(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => a == b || a.as_f64() == b.as_f64(),
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same_value(a, b)),
        _ => a == b,
    }
}

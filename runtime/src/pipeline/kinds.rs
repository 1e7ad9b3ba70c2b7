//! The reference of all stage kinds, from the doc comments of the code.

use super::parameter_schema::{ParameterInfo, parameters_of};
use super::reference::type_text;
use super::text_layout::{push_filled, push_table};
use crate::stage::{Registry, StageKind};
use serde_json::{Value, json};

/// The descriptions of all kinds, wrapped at `width` characters.
pub fn kinds_text(registry: &Registry, width: usize) -> String {
    registry.kinds().map(|kind| kind_text(kind, width)).collect::<Vec<_>>().join("\n")
}

/// The description of a kind, wrapped at `width` characters: summary, inputs, outputs and parameters.
pub fn kind_text(kind: &StageKind, width: usize) -> String {
    let mut page = format!("{}\n", kind.name);
    push_filled(&mut page, 2, width, kind.summary);
    let inputs: Vec<[String; 3]> = kind
        .inputs
        .iter()
        .map(|port| {
            let many = if port.many { ", any number of them" } else { "" };
            let optional = if port.optional { ", may be left out" } else { "" };
            [port.name.to_owned(), format!("{}{many}{optional}", type_text(port.port_type)), port.summary.to_owned()]
        })
        .collect();
    let outputs: Vec<[String; 3]> = kind
        .outputs
        .iter()
        .map(|port| {
            let topic = port.topic.map(|topic| format!(" (on {topic})")).unwrap_or_default();
            [port.name.to_owned(), type_text(port.port_type), format!("{}{topic}", port.summary)]
        })
        .collect();
    for (title, rows) in [("inputs", inputs), ("outputs", outputs)] {
        if !rows.is_empty() {
            page.push_str(&format!("\n  {title}\n"));
            push_table(&mut page, 4, width, &rows);
        }
    }
    let parameters = parameters_of(kind);
    if !parameters.is_empty() {
        page.push_str("\n  parameters\n");
        parameters.iter().for_each(|parameter| push_parameter(&mut page, width, parameter));
    }
    page
}

fn push_parameter(page: &mut String, width: usize, parameter: &ParameterInfo) {
    let ParameterInfo { name, type_text, default, .. } = parameter;
    let line = match default {
        Some(value) if !value.is_null() => format!("{name} = {}  ({type_text})", toml_text(value)),
        _ if parameter.optional => format!("{name}  ({type_text}, may be left out)"),
        _ => format!("{name}  ({type_text})"),
    };
    match line.chars().count() + 4 <= width {
        true => page.push_str(&format!("    {line}\n")),
        false => push_filled(page, 4, width, &line),
    }
    push_filled(page, 8, width, &parameter.doc);
    for (value, doc) in parameter.values.iter().filter(|(_, doc)| !doc.is_empty()) {
        push_filled(page, 8, width, &format!("\"{value}\": {doc}"));
    }
}

/// A JSON value in the syntax of a pipeline file.
pub(super) fn toml_text(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(toml_text).collect::<Vec<_>>().join(", ")),
        Value::Object(entries) => {
            let given = entries.iter().filter(|(_, value)| !value.is_null());
            let entries: Vec<String> = given.map(|(key, value)| format!("{key} = {}", toml_text(value))).collect();
            format!("{{ {} }}", entries.join(", "))
        }
        other => other.to_string(),
    }
}

/// All kinds as JSON, for programs: a list with the contents of [`kind_text`] and the JSON schema of the parameters.
pub fn kinds_json(registry: &Registry) -> Value {
    registry.kinds().map(kind_json).collect()
}

/// A kind as JSON, for programs.
pub fn kind_json(kind: &StageKind) -> Value {
    let inputs = kind.inputs.iter().map(|port| {
        json!({
            "name": port.name, "type": port.port_type.to_string(), "many": port.many, "optional": port.optional,
            "summary": port.summary,
        })
    });
    let outputs = kind.outputs.iter().map(|port| {
        json!({ "name": port.name, "type": port.port_type.to_string(), "topic": port.topic, "summary": port.summary })
    });
    json!({
        "name": kind.name,
        "summary": kind.summary,
        "inputs": inputs.collect::<Vec<_>>(),
        "outputs": outputs.collect::<Vec<_>>(),
        "parameters": parameters_of(kind).iter().map(ParameterInfo::to_json).collect::<Vec<_>>(),
        "schema": kind.parameter_schema(),
    })
}

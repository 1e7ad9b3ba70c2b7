//! Descriptions of the parameters of a stage kind, from its JSON schema.

use crate::stage::StageKind;
use crate::stage::range::Range;
use serde_json::{Map, Value};

/// The description of a parameter of a stage kind.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterInfo {
    /// Its name; a parameter within a table is prefixed by the table's name and a dot.
    pub name: String,
    /// Its type in words, such as `number` or `"blocks" | "window"`.
    pub type_text: String,
    /// Whether it may have no value.
    pub optional: bool,
    /// Its default.
    pub default: Option<Value>,
    /// Its documentation, from the doc comment in the code.
    pub doc: String,
    /// The allowed values with their documentation, if they can be listed.
    pub values: Vec<(String, String)>,
}

/// The parameters of a kind, in the order of the code.
pub fn parameters_of(kind: &StageKind) -> Vec<ParameterInfo> {
    let root = kind.parameter_schema().as_value();
    let mut parameters = Vec::new();
    collect(root, root, "", 0, &mut parameters);
    parameters
}

/// The maximum depth of nested tables that are described.
const MAX_DEPTH: usize = 3;

fn collect(root: &Value, table: &Value, prefix: &str, depth: usize, parameters: &mut Vec<ParameterInfo>) {
    for (name, property) in table.get("properties").and_then(Value::as_object).into_iter().flatten() {
        let name = format!("{prefix}{name}");
        let Resolved { schema, optional } = resolve(root, property);
        let doc = description(property).or_else(|| description(schema)).unwrap_or_default();
        let values = choices(schema).unwrap_or_default();
        let default = property.get("default").cloned();
        let type_text = type_text(root, schema);
        parameters.push(ParameterInfo { name: name.clone(), type_text, optional, default, doc, values });
        if depth < MAX_DEPTH {
            collect(root, schema, &format!("{name}."), depth + 1, parameters);
        }
    }
}

/// A schema with resolved references, and whether null is allowed.
struct Resolved<'a> {
    schema: &'a Value,
    optional: bool,
}

fn resolve<'a>(root: &'a Value, mut schema: &'a Value) -> Resolved<'a> {
    let mut optional = false;
    // The limit ends cyclic references; no valid schema nests this deep.
    for _ in 0..16 {
        let target = schema.get("$ref").and_then(Value::as_str).and_then(|path| path.strip_prefix('#'));
        let either = schema.get("anyOf").and_then(Value::as_array);
        schema = match (target.and_then(|path| root.pointer(path)), either.map(Vec::as_slice)) {
            (Some(target), _) => target,
            (None, Some([one, null])) if is_null(null) => {
                optional = true;
                one
            }
            _ => break,
        };
    }
    let null = Value::from("null");
    optional |= schema.get("type").and_then(Value::as_array).is_some_and(|types| types.contains(&null));
    Resolved { schema, optional }
}

fn is_null(schema: &Value) -> bool {
    schema.get("type").and_then(Value::as_str) == Some("null")
}

/// The type of a schema in words: `number`, `list of whole numbers`, `"a" | "b"`.
fn type_text(root: &Value, schema: &Value) -> String {
    let schema = resolve(root, schema).schema;
    if let Some(choices) = choices(schema) {
        let quoted: Vec<String> = choices.iter().map(|(value, _)| format!("\"{value}\"")).collect();
        return quoted.join(" | ");
    }
    let types = schema.get("type");
    let first = types.and_then(Value::as_array).and_then(|types| types.iter().find(|name| *name != "null"));
    match first.or(types).and_then(Value::as_str) {
        Some("number") => format!("number{}", range(schema)),
        Some("integer") => format!("whole number{}", range(schema)),
        Some("string") => "text".to_owned(),
        Some("boolean") => "true or false".to_owned(),
        Some("array") => list_text(root, schema),
        Some("object") => "table".to_owned(),
        _ => "value".to_owned(),
    }
}

/// The range of a number, as a suffix of its type.
fn range(schema: &Value) -> String {
    match Range::of(schema).to_string() {
        limits if limits.is_empty() => limits,
        limits if limits.starts_with("at ") => format!(" of {limits}"),
        limits => format!(" {limits}"),
    }
}

fn list_text(root: &Value, schema: &Value) -> String {
    let item = schema.get("items").map_or_else(|| "value".to_owned(), |item| type_text(root, item));
    let length = |name: &str| schema.get(name).and_then(Value::as_u64);
    let exact = length("minItems").filter(|&least| length("maxItems") == Some(least));
    let items = match item.split_once("number") {
        Some((before, after)) if !item.contains("list of") => format!("{before}numbers{after}"),
        _ if item == "text" => "texts".to_owned(),
        _ if item == "value" || item == "table" => format!("{item}s"),
        _ => format!("({item})"),
    };
    match exact {
        Some(length) => format!("list of {length} {items}"),
        None => format!("list of {items}"),
    }
}

/// The allowed values with their documentation, if they can be listed.
fn choices(schema: &Value) -> Option<Vec<(String, String)>> {
    let plain = |schema: &Value| -> Option<Vec<(String, String)>> {
        let values = schema.get("enum")?.as_array()?;
        values
            .iter()
            .filter(|value| !value.is_null())
            .map(|value| Some((value.as_str()?.to_owned(), String::new())))
            .collect()
    };
    if let Some(values) = plain(schema) {
        return Some(values);
    }
    let mut values = Vec::new();
    for variant in schema.get("oneOf")?.as_array()? {
        match variant.get("const").and_then(Value::as_str) {
            Some(value) => values.push((value.to_owned(), description(variant).unwrap_or_default())),
            None => values.extend(plain(variant)?),
        }
    }
    Some(values)
}

/// The doc comment, with line breaks replaced by spaces, except between paragraphs.
fn description(schema: &Value) -> Option<String> {
    let text = schema.get("description")?.as_str()?;
    let paragraphs = text.split("\n\n").map(|lines| lines.split_whitespace().collect::<Vec<_>>().join(" "));
    Some(paragraphs.collect::<Vec<_>>().join("\n\n"))
}

impl ParameterInfo {
    /// The type with its article, to follow "expected": `a number`, `text`, `"blocks" or "window"`.
    pub(super) fn expected(&self) -> String {
        let choices: Vec<String> = self.values.iter().map(|(value, _)| format!("\"{value}\"")).collect();
        match choices.split_last() {
            Some((last, [])) => last.clone(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None if self.type_text == "text" || self.type_text == "true or false" => self.type_text.clone(),
            None => format!("a {}", self.type_text),
        }
    }

    /// The parameter as JSON, for programs.
    pub(super) fn to_json(&self) -> Value {
        let mut json = Map::new();
        json.insert("name".into(), self.name.as_str().into());
        json.insert("type".into(), self.type_text.as_str().into());
        json.insert("optional".into(), self.optional.into());
        json.insert("default".into(), self.default.clone().unwrap_or_default());
        json.insert("doc".into(), self.doc.as_str().into());
        if !self.values.is_empty() {
            let value = |(value, doc): &(String, String)| serde_json::json!({ "value": value, "doc": doc });
            json.insert("values".into(), self.values.iter().map(value).collect());
        }
        json.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn shown(root: &Value) -> Vec<(String, String, bool)> {
        let mut parameters = Vec::new();
        collect(root, root, "", 0, &mut parameters);
        parameters.into_iter().map(|info| (info.name, info.type_text, info.optional)).collect()
    }

    #[test]
    fn types_are_described_in_words() {
        let cases = [
            (json!({ "type": "number" }), "number"),
            (json!({ "type": ["number", "null"], "exclusiveMinimum": 0 }), "number above 0"),
            (json!({ "type": "number", "minimum": 0.0, "maximum": 1.5 }), "number from 0 to 1.5"),
            (
                json!({ "type": "integer", "format": "uint8", "minimum": 0, "maximum": 255 }),
                "whole number from 0 to 255",
            ),
            (json!({ "type": "integer", "format": "int64" }), "whole number"),
            (json!({ "type": "array", "items": { "type": "string" } }), "list of texts"),
            (
                json!({ "type": "array", "items": { "type": "integer", "minimum": 0 } }),
                "list of whole numbers of at least 0",
            ),
            (
                json!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 }),
                "list of 3 numbers",
            ),
            (
                json!({ "type": "array", "items": { "type": "array", "items": { "type": "number" } } }),
                "list of (list of numbers)",
            ),
            (json!({ "type": "string", "enum": ["a", "b"] }), "\"a\" | \"b\""),
            (json!(true), "value"),
        ];
        for (schema, expected) in cases {
            assert_eq!(type_text(&schema, &schema), expected);
        }
    }

    #[test]
    fn an_optional_choice_and_a_table_in_a_table_are_resolved() {
        let root = json!({
            "properties": {
                "mode": { "anyOf": [{ "$ref": "#/$defs/Mode" }, { "type": "null" }] },
                "tf": { "$ref": "#/$defs/Frames" },
            },
            "$defs": {
                "Mode": { "oneOf": [{ "const": "a", "description": "First." }, { "type": "string", "enum": ["b", "c"] }] },
                "Frames": { "type": "object", "properties": { "map_frame": { "type": "string" } } },
            },
        });
        let expected =
            [("mode", "\"a\" | \"b\" | \"c\"", true), ("tf", "table", false), ("tf.map_frame", "text", false)];
        let expected = expected.map(|(name, text, optional)| (name.to_owned(), text.to_owned(), optional));
        assert_eq!(shown(&root), expected);
    }

    #[test]
    fn a_cyclic_schema_ends() {
        let root = json!({ "properties": { "a": { "$ref": "#/properties/a" }, "b": { "$ref": "#" } } });
        assert!(shown(&root).len() < 100);
    }
}

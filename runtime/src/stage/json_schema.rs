//! Validation of parameters by the JSON schema of a program.
//!
//! The supported subset of JSON Schema is `type` (one of number, integer, string, boolean, array), `enum` of strings,
//! `minimum`, `maximum`, `exclusiveMinimum`, `exclusiveMaximum`, and `items`. Everything else is ignored.

use super::ParameterError;
use super::range::out_of_range;
use schemars::Schema;
use serde::de::Error;
use serde_json::Value;

/// Checks parameters, all of which are optional, and returns every value that is out of its range. A parameter that is
/// not in the schema is ignored.
///
/// # Errors
/// A parameter does not have the type of its schema.
pub(super) fn check(schema: &Schema, table: &toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> {
    let properties = schema.get("properties").and_then(Value::as_object);
    for (name, property) in properties.into_iter().flatten() {
        let Some(value) = table.get(name) else { continue };
        if let Some(expected) = mismatch(property, value) {
            return Err(toml::de::Error::custom(format!("invalid type: {}, expected {expected}", value.type_str())));
        }
    }
    Ok(out_of_range(schema.as_value(), table))
}

/// The expected type or choices, if a value does not match.
fn mismatch(schema: &Value, value: &toml::Value) -> Option<String> {
    let expected = schema.get("type").and_then(Value::as_str)?;
    if let (Some(choices), toml::Value::String(text)) = (schema.get("enum").and_then(Value::as_array), value) {
        let fits = choices.iter().any(|choice| choice.as_str() == Some(text));
        return (!fits)
            .then(|| format!("one of {}", choices.iter().map(Value::to_string).collect::<Vec<_>>().join(", ")));
    }
    let fits = match (expected, value) {
        ("number", toml::Value::Float(_) | toml::Value::Integer(_)) => true,
        ("integer", toml::Value::Integer(_)) | ("string", toml::Value::String(_)) => true,
        ("boolean", toml::Value::Boolean(_)) => true,
        ("array", toml::Value::Array(items)) => {
            let of_item = |item: &toml::Value| schema.get("items").and_then(|schema| mismatch(schema, item));
            return items.iter().find_map(of_item).map(|expected| format!("a list with {expected}"));
        }
        ("number" | "integer" | "string" | "boolean" | "array", _) => false,
        // The program itself must check an unsupported type.
        _ => true,
    };
    (!fits).then(|| format!("a value of type {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn checked(parameters: &str) -> Result<Vec<ParameterError>, toml::de::Error> {
        let schema = json!({ "properties": {
            "length": { "type": "number", "exclusiveMinimum": 0 },
            "count": { "type": "integer", "minimum": 1, "maximum": 9 },
            "way": { "type": "string", "enum": ["near", "far"] },
            "sizes": { "type": "array", "items": { "type": "number", "minimum": 0 } },
            "own": { "type": "something else" },
        } });
        check(&schema.try_into().unwrap(), &parameters.parse().unwrap())
    }

    #[test]
    fn values_of_the_right_type_and_in_range_are_valid_and_an_integer_is_a_number() {
        let text = "length = 1\ncount = 9\nway = \"far\"\nsizes = [0, 1.5]\nown = {}\nunknown = 1";
        assert_eq!(checked(text).unwrap(), []);
    }

    #[test]
    fn a_wrong_type_is_an_error() {
        for text in ["length = \"a\"", "count = 1.5", "way = \"fra\"", "way = 1", "sizes = 1", "sizes = [\"a\"]"] {
            assert!(checked(text).is_err(), "{text}");
        }
    }

    #[test]
    fn every_value_out_of_range_is_reported() {
        let errors = checked("length = 0\ncount = 10\nsizes = [1, -1]").unwrap();
        let reported: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(
            reported,
            [
                "`length` must be above 0, not 0",
                "`count` must be from 1 to 9, not 10",
                "`sizes` must be at least 0, not -1",
            ]
        );
    }
}

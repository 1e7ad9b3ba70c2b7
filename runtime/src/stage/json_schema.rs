//! Parameters that a program describes, checked by their JSON schema.
//!
//! Of JSON Schema it knows what a parameter needs: `type` (one of number, integer, string, boolean, array), `enum` of texts,
//! `minimum`, `maximum`, `exclusiveMinimum` and `exclusiveMaximum`, and `items`. What else a schema says is for people to read.

use super::ParameterError;
use schemars::Schema;
use serde::de::Error;
use serde_json::Value;

/// Checks parameters, any of which may be left out: an error if one has another type than its schema says, and otherwise every
/// value that is out of its range. A parameter that the schema does not know is passed over.
pub(super) fn check(schema: &Schema, table: &toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> {
    let properties = schema.get("properties").and_then(Value::as_object);
    let mut errors = Vec::new();
    for (name, property) in properties.into_iter().flatten() {
        let Some(value) = table.get(name) else { continue };
        if let Some(expected) = mismatch(property, value) {
            return Err(toml::de::Error::custom(format!("invalid type: {}, expected {expected}", value.type_str())));
        }
        // The name is kept for as long as the program runs: it comes up only while somebody mends a file.
        errors.extend(problem(property, value).map(|problem| ParameterError::new(name.clone().leak(), problem)));
    }
    Ok(errors)
}

/// What was expected of a value, if it is not that.
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
        // A type that is not known here is for the program itself to check.
        _ => true,
    };
    (!fits).then(|| format!("a value of type {expected}"))
}

/// What is wrong with a number that its type allows, or with one in a list.
fn problem(schema: &Value, value: &toml::Value) -> Option<String> {
    if let toml::Value::Array(items) = value {
        let items_schema = schema.get("items")?;
        return items.iter().find_map(|item| problem(items_schema, item));
    }
    let number = value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64))?;
    if !number.is_finite() {
        return Some("must be a finite number".to_owned());
    }
    let limit = |name: &str| schema.get(name).and_then(Value::as_f64);
    let below = limit("minimum").filter(|least| number < *least).map(|least| format!("must be {least} or more"));
    let above = limit("maximum").filter(|most| number > *most).map(|most| format!("must be {most} or less"));
    let at_least =
        limit("exclusiveMinimum").filter(|least| number <= *least).map(|least| format!("must be above {least}"));
    let at_most = limit("exclusiveMaximum").filter(|most| number >= *most).map(|most| format!("must be below {most}"));
    below.or(above).or(at_least).or(at_most)
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
    fn values_of_the_right_type_and_in_range_pass_and_a_whole_number_is_a_number() {
        let text = "length = 1\ncount = 9\nway = \"far\"\nsizes = [0, 1.5]\nown = {}\nunknown = 1";
        assert_eq!(checked(text).unwrap(), []);
    }

    #[test]
    fn another_type_is_an_error() {
        for text in ["length = \"a\"", "count = 1.5", "way = \"fra\"", "way = 1", "sizes = 1", "sizes = [\"a\"]"] {
            assert!(checked(text).is_err(), "{text}");
        }
    }

    #[test]
    fn every_value_out_of_range_is_told() {
        let errors = checked("length = 0\ncount = 10\nsizes = [1, -1]").unwrap();
        let told: Vec<String> = errors.iter().map(ToString::to_string).collect();
        assert_eq!(told, ["`length` must be above 0", "`count` must be 9 or less", "`sizes` must be 0 or more"]);
        assert_eq!(checked("length = inf").unwrap()[0].problem, "must be a finite number");
    }
}

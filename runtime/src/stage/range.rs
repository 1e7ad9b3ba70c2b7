//! The ranges of parameters, given by attributes of their fields: `#[schemars(range(min = 0.0, max = 1.0))]`, or
//! `#[schemars(extend("exclusiveMinimum" = 0.0))]` if the limit itself is not allowed.

use super::ParameterError;
use serde_json::Value;
use std::fmt;

/// The allowed range of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    least: Option<Limit>,
    most: Option<Limit>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Limit {
    value: f64,
    is_allowed: bool,
}

impl Range {
    /// The range in a JSON schema.
    pub(crate) fn of(schema: &Value) -> Self {
        let limit = |inclusive: &str, exclusive: &str| {
            let value = |key: &str| schema.get(key).and_then(Value::as_f64);
            let allowed = value(inclusive).map(|value| Limit { value, is_allowed: true });
            value(exclusive).map(|value| Limit { value, is_allowed: false }).or(allowed)
        };
        // The limits of an integer type are no chosen range.
        let is_of_memory = |limit: &Limit| {
            let format = schema.get("format").and_then(Value::as_str).unwrap_or_default();
            matches!(
                (format, limit.value),
                ("uint16", 65535.0) | ("int8", -128.0 | 127.0) | ("int16", -32768.0 | 32767.0)
            )
        };
        let chosen = |limit: Option<Limit>| limit.filter(|limit| !is_of_memory(limit));
        Self { least: chosen(limit("minimum", "exclusiveMinimum")), most: chosen(limit("maximum", "exclusiveMaximum")) }
    }

    /// Whether a number is in the range. A number that is not finite never is.
    fn contains(&self, value: f64) -> bool {
        let is_above = self.least.is_none_or(|least| value > least.value || (least.is_allowed && value == least.value));
        let is_below = self.most.is_none_or(|most| value < most.value || (most.is_allowed && value == most.value));
        value.is_finite() && is_above && is_below
    }
}

/// `from 0 to 1`, `above 0`, `at least 0 and below 1`; nothing if there are no limits.
impl fmt::Display for Range {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let least = self.least.map(|Limit { value, is_allowed }| match is_allowed {
            true => format!("at least {value}"),
            false => format!("above {value}"),
        });
        let most = self.most.map(|Limit { value, is_allowed }| match is_allowed {
            true => format!("at most {value}"),
            false => format!("below {value}"),
        });
        match (self.least, self.most, least, most) {
            (Some(Limit { value: least, is_allowed: true }), Some(Limit { value: most, is_allowed: true }), ..) => {
                write!(out, "from {least} to {most}")
            }
            (.., Some(least), Some(most)) => write!(out, "{least} and {most}"),
            (.., least, most) => out.write_str(&least.or(most).unwrap_or_default()),
        }
    }
}

/// The values of a table that are out of the ranges of its schema, one error for each.
pub(crate) fn out_of_range(schema: &Value, table: &toml::Table) -> Vec<ParameterError> {
    let properties = schema.get("properties").and_then(Value::as_object).into_iter().flatten();
    let wrong = properties.filter_map(|(field, schema)| {
        let problem = problem(schema, table.get(field)?)?;
        Some(ParameterError::new(field, problem))
    });
    wrong.collect()
}

/// The error of a number, or of the first wrong number of a list.
fn problem(schema: &Value, value: &toml::Value) -> Option<String> {
    let value = match value {
        toml::Value::Float(value) => *value,
        toml::Value::Integer(value) => *value as f64,
        toml::Value::Array(items) => {
            let schema = schema.get("items")?;
            return items.iter().find_map(|item| problem(schema, item));
        }
        _ => return None,
    };
    let range = Range::of(schema);
    (!range.contains(value)).then(|| match range.to_string() {
        limits if limits.is_empty() => format!("must be a finite number, not {value}"),
        limits => format!("must be {limits}, not {value}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn problems(schema: &Value, value: impl Into<toml::Value>) -> Vec<String> {
        let schema = json!({ "properties": { "a": schema, "b": { "type": "string" } } });
        let table = toml::Table::from_iter([("a".to_owned(), value.into()), ("b".to_owned(), "text".into())]);
        out_of_range(&schema, &table).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_error_of_a_value_out_of_range_states_the_range() {
        let share = json!({ "minimum": 0.0, "maximum": 1.0 });
        assert!(problems(&share, 0.0).is_empty() && problems(&share, 1).is_empty());
        assert_eq!(problems(&share, 1.5), ["`a` must be from 0 to 1, not 1.5"]);
        assert_eq!(problems(&share, f64::NAN), ["`a` must be from 0 to 1, not NaN"]);
        let open = json!({ "minimum": 0, "exclusiveMinimum": 0.5, "exclusiveMaximum": 1.0 });
        assert!(problems(&open, 0.75).is_empty());
        assert_eq!(problems(&open, 0.5), ["`a` must be above 0.5 and below 1, not 0.5"]);
        assert_eq!(problems(&json!({ "minimum": 1 }), 0), ["`a` must be at least 1, not 0"]);
        assert_eq!(problems(&json!({ "exclusiveMinimum": 0 }), 0.0), ["`a` must be above 0, not 0"]);
        assert_eq!(problems(&json!({ "maximum": 2 }), 3), ["`a` must be at most 2, not 3"]);
    }

    #[test]
    fn without_a_range_a_number_must_be_finite() {
        let number = json!({ "type": "number" });
        assert!(problems(&number, -1e300).is_empty());
        assert_eq!(problems(&number, f64::INFINITY), ["`a` must be a finite number, not inf"]);
    }

    #[test]
    fn the_items_of_a_list_have_their_range() {
        let sizes = json!({ "items": { "minimum": 0 } });
        assert!(problems(&sizes, vec![0.0, 1.5]).is_empty());
        assert_eq!(problems(&sizes, vec![1.0, -1.0, -2.0]), ["`a` must be at least 0, not -1"]);
    }

    #[test]
    fn limits_of_an_integer_type_are_no_range() {
        let range = |schema: Value| Range::of(&schema).to_string();
        assert_eq!(range(json!({ "format": "uint16", "minimum": 1, "maximum": 65535 })), "at least 1");
        assert_eq!(range(json!({ "format": "uint8", "minimum": 0, "maximum": 255 })), "from 0 to 255");
    }
}

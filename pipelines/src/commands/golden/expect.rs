//! `[[expect]]`: conditions that must hold, also for an expected log that was blessed.

use super::recording::{Recorded, Recording};
use anyhow::{Context, Result, bail};
use gridweave_logs::dynamic::{Array, FieldPath, Scalar, Schema, Value, nearly_equal};
use gridweave_runtime::pipeline::suggest;
use gridweave_runtime::stage::StageKind;
use serde::Deserialize;

/// An entry of the file, not checked.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ExpectEntry {
    port: Option<String>,
    message: Option<i64>,
    field: Option<String>,
    equals: Option<toml::Value>,
    within: Option<f64>,
    length: Option<u64>,
    value: Option<toml::Value>,
    messages: Option<u64>,
    warning: Option<String>,
    count: Option<u64>,
}

/// A condition.
#[derive(Debug)]
pub(super) enum Expect {
    /// A warning was given `count` times.
    Warning { text: String, count: u64 },
    /// A port has sent `count` messages.
    Messages { port: usize, name: String, count: u64 },
    /// A field of a message passes the check.
    Field { port: usize, name: String, message: i64, path: FieldPath, check: FieldCheck },
}

/// A condition of a field.
#[derive(Debug)]
pub(super) enum FieldCheck {
    /// The field has this value, or one within a distance of it.
    Equals { value: toml::Value, within: Option<f64> },
    /// The field is an array of this length.
    Length(u64),
    /// The field is an array with `count` elements of this value.
    Count { value: toml::Value, count: u64 },
}

impl Expect {
    /// Checks an entry: it must have one condition, for a port of the kind.
    pub(super) fn new(entry: ExpectEntry, kind: &StageKind) -> Result<Self> {
        let ExpectEntry { port, message, field, equals, within, length, value, messages, warning, count } = entry;
        if within.is_some_and(|within| !(within.is_finite() && within >= 0.0)) {
            bail!("`within` must be 0 or more");
        }
        if within.is_some() && equals.is_none() {
            bail!("`within` needs `equals`");
        }
        if let Some(text) = warning {
            let alone = port.is_none() && message.is_none() && field.is_none() && messages.is_none();
            let alone = alone && equals.is_none() && length.is_none() && value.is_none();
            return match count.filter(|_| alone) {
                Some(count) => Ok(Self::Warning { text, count }),
                None => bail!("`warning` needs `count`, and no other key"),
            };
        }
        let name = port.context("neither `port` nor `warning` is given")?;
        let names: Vec<&str> = kind.outputs.iter().map(|port| port.name).collect();
        let port = names.iter().position(|port| *port == name).with_context(|| {
            let help = suggest(&name, &names, "its outputs").unwrap_or_else(|| "it has no outputs".to_owned());
            format!("`{}` has no output `{name}`; {help}", kind.name)
        })?;
        if let Some(expected) = messages {
            let of_message = field.is_some() || message.is_some() || equals.is_some();
            if of_message || length.is_some() || value.is_some() || count.is_some() {
                bail!("`messages` needs `port`, and no other key");
            }
            return Ok(Self::Messages { port, name, count: expected });
        }
        let path = field.context("neither `field` nor `messages` is given")?.parse()?;
        let check = match (equals, length, value, count) {
            (Some(value), None, None, None) => FieldCheck::Equals { value, within },
            (None, Some(length), None, None) => FieldCheck::Length(length),
            (None, None, Some(value), Some(count)) => FieldCheck::Count { value, count },
            _ => bail!("`field` needs one of: `equals`; `length`; `value` and `count`"),
        };
        Ok(Self::Field { port, name, message: message.unwrap_or_default(), path, check })
    }

    /// Checks the condition; the error says what does not hold. Numbers with a fraction may differ by `tolerance`
    /// unless `within` is given.
    pub(super) fn check(&self, got: &Recording, tolerance: f64) -> Result<(), String> {
        match self {
            Self::Warning { text, count } => {
                let given = got.warnings.get(text).copied().unwrap_or_default();
                match given == *count {
                    true => Ok(()),
                    false => {
                        Err(format!("the warning {text:?} must be given {count} times, and was given {given} times"))
                    }
                }
            }
            Self::Messages { port, name, count } => {
                let sent = of_port(got, *port).count() as u64;
                match sent == *count {
                    true => Ok(()),
                    false => Err(format!("`{name}` must send {count} messages, and has sent {sent}")),
                }
            }
            Self::Field { port, name, message, path, check } => {
                let messages: Vec<&Recorded> = of_port(got, *port).collect();
                let index = if *message < 0 { messages.len() as i64 + message } else { *message };
                let found = usize::try_from(index).ok().and_then(|index| messages.get(index));
                let found = found.ok_or_else(|| {
                    format!("`{name}` has sent {} messages, and none has the number {message}", messages.len())
                })?;
                let what = format!("{path} of message {message} of `{name}`");
                let schema = Schema::of_channel(&found.channel).map_err(|error| format!("{what}: {error}"))?;
                let value = schema.decode(&found.bytes).map_err(|error| format!("{what}: {error}"))?;
                let value = value.find(path).map_err(|error| format!("{what}: {error}"))?;
                check.check(&value, tolerance).map_err(|problem| format!("{what} {problem}"))
            }
        }
    }
}

fn of_port(got: &Recording, port: usize) -> impl Iterator<Item = &Recorded> {
    got.messages.iter().filter(move |message| message.port == Some(port))
}

impl FieldCheck {
    fn check(&self, got: &Value<'_>, tolerance: f64) -> Result<(), String> {
        match self {
            Self::Equals { value, within } => match equal(got, value, *within, tolerance) {
                true => Ok(()),
                false => {
                    let within = within.map(|within| format!(" within {within}")).unwrap_or_default();
                    Err(format!("must be {value}{within}, and is {got}"))
                }
            },
            Self::Length(length) => match got {
                Value::Array(array) if array.len() as u64 == *length => Ok(()),
                Value::Array(array) => Err(format!("must have {length} elements, and has {}", array.len())),
                other => Err(format!("must be an array, and is {other}")),
            },
            Self::Count { value, count } => {
                let Value::Array(array) = got else { return Err(format!("must be an array, and is {got}")) };
                let scalars = (0..array.len()).filter_map(|at| array.scalar(at));
                let found = scalars.filter(|scalar| scalar_equals(scalar, value, None, tolerance)).count() as u64;
                match found == *count {
                    true => Ok(()),
                    false => Err(format!("must have {count} elements of the value {value}, and has {found}")),
                }
            }
        }
    }
}

fn equal(got: &Value<'_>, expected: &toml::Value, within: Option<f64>, tolerance: f64) -> bool {
    match (got, expected) {
        (Value::Scalar(scalar), expected) => scalar_equals(scalar, expected, within, tolerance),
        (Value::Array(array), toml::Value::Array(expected)) if !matches!(array, Array::Messages(_)) => {
            let equal = |(at, expected): (usize, &toml::Value)| {
                array.scalar(at).is_some_and(|scalar| scalar_equals(&scalar, expected, within, tolerance))
            };
            array.len() == expected.len() && expected.iter().enumerate().all(equal)
        }
        _ => false,
    }
}

fn scalar_equals(got: &Scalar<'_>, expected: &toml::Value, within: Option<f64>, tolerance: f64) -> bool {
    let number = match expected {
        toml::Value::String(text) => return matches!(got, Scalar::Text(got) if got == text),
        toml::Value::Boolean(value) => return matches!(got, Scalar::Bool(got) if got == value),
        toml::Value::Float(number) => *number,
        toml::Value::Integer(number) => match (got, within) {
            (Scalar::Int(got), None) => return got == number,
            (Scalar::Uint(got), None) => return i128::from(*got) == i128::from(*number),
            _ => *number as f64,
        },
        _ => return false,
    };
    match (got, within) {
        // The expected number is rounded to a float32, too.
        (Scalar::F32(got), None) => *got == number as f32 || nearly_equal((*got).into(), number, tolerance),
        (got, None) => got.as_f64().is_some_and(|got| nearly_equal(got, number, tolerance)),
        (got, Some(within)) => got.as_f64().is_some_and(|got| (got - number).abs() <= within),
    }
}

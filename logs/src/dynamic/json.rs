//! Values as JSON.

use super::value::{Array, Scalar, Value};
use serde_json::Value as Json;

/// Options for the conversion of a value to JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JsonOptions {
    /// The maximum number of array elements that are shown, followed by a text with the number of the rest; `None` for
    /// all.
    pub longest_array: Option<usize>,
}

impl Value<'_> {
    /// Converts the value to JSON. Numbers that JSON does not have are the strings `NaN`, `Infinity` and `-Infinity`.
    pub fn to_json(&self, options: JsonOptions) -> Json {
        match self {
            Self::Scalar(scalar) => scalar_json(scalar),
            Self::Array(array) => array_json(array, options),
            Self::Message(fields) => {
                Json::Object(fields.iter().map(|(name, value)| ((*name).to_owned(), value.to_json(options))).collect())
            }
        }
    }
}

fn scalar_json(scalar: &Scalar<'_>) -> Json {
    let number = |number: f64| match number {
        number if number.is_finite() => number.into(),
        number if number.is_nan() => "NaN".into(),
        number if number > 0.0 => "Infinity".into(),
        _ => "-Infinity".into(),
    };
    match *scalar {
        Scalar::Bool(value) => value.into(),
        Scalar::Int(number) => number.into(),
        Scalar::Uint(number) => number.into(),
        // Converted by decimal digits, so that 0.05 does not become 0.05000000074505806.
        Scalar::F32(value) => number(format!("{value:?}").parse().unwrap_or_else(|_| value.into())),
        Scalar::F64(value) => number(value),
        Scalar::Text(text) => text.into(),
    }
}

fn array_json(array: &Array<'_>, options: JsonOptions) -> Json {
    let shown = options.longest_array.map_or(array.len(), |longest| longest.min(array.len()));
    let mut list: Vec<Json> = match array {
        Array::Messages(messages) => messages.iter().take(shown).map(|message| message.to_json(options)).collect(),
        _ => (0..shown).filter_map(|at| array.scalar(at)).map(|scalar| scalar_json(&scalar)).collect(),
    };
    if shown < array.len() {
        list.push(format!("... {} more", array.len() - shown).into());
    }
    Json::Array(list)
}

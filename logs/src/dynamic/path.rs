//! The path of a field: `tags[0].tag_id`.

use super::value::Value;
use std::fmt;
use std::str::FromStr;

/// The path of a field in a message, such as `tags[0].tag_id`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldPath(Vec<Step>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Field(String),
    Element(usize),
}

/// The error when a path is invalid or does not exist.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// It is not a path.
    #[error("`{0}` is not a field path: write it as in `tags[0].tag_id`")]
    Form(String),
    /// There is no field with that name.
    #[error("{within} has no field `{field}`{}", names(.known))]
    NoField {
        /// The part of the message that was searched.
        within: String,
        /// The name.
        field: String,
        /// The existing fields; empty if the part is not a message.
        known: Vec<String>,
    },
    /// There is no such array element.
    #[error("{within} has {length} elements, and no element {element}")]
    NoElement {
        /// The array.
        within: String,
        /// The index.
        element: usize,
        /// The number of elements.
        length: usize,
    },
    /// It is not an array.
    #[error("{0} is not an array")]
    NoArray(String),
}

fn names(known: &[String]) -> String {
    match known.is_empty() {
        true => String::new(),
        false => format!("; it has {}", known.join(", ")),
    }
}

impl FromStr for FieldPath {
    type Err = PathError;

    fn from_str(text: &str) -> Result<Self, PathError> {
        let wrong = || PathError::Form(text.to_owned());
        let mut steps = Vec::new();
        for part in text.split('.') {
            let (name, elements) = part.split_at(part.find('[').unwrap_or(part.len()));
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                return Err(wrong());
            }
            steps.push(Step::Field(name.to_owned()));
            let mut rest = elements;
            while !rest.is_empty() {
                let (number, after) = rest.strip_prefix('[').and_then(|rest| rest.split_once(']')).ok_or_else(wrong)?;
                steps.push(Step::Element(number.parse().map_err(|_| wrong())?));
                rest = after;
            }
        }
        Ok(Self(steps))
    }
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().enumerate().try_for_each(|(at, step)| match step {
            Step::Field(name) if at == 0 => f.write_str(name),
            Step::Field(name) => write!(f, ".{name}"),
            Step::Element(number) => write!(f, "[{number}]"),
        })
    }
}

impl<'a> Value<'a> {
    /// The value at a path.
    pub fn find(&self, path: &FieldPath) -> Result<Value<'a>, PathError> {
        let mut value = self.clone();
        for (at, step) in path.0.iter().enumerate() {
            let within = || match at {
                0 => "the message".to_owned(),
                _ => format!("`{}`", FieldPath(path.0[..at].to_vec())),
            };
            value = match (step, &value) {
                (Step::Field(name), _) => value.field(name).cloned().ok_or_else(|| PathError::NoField {
                    within: within(),
                    field: name.clone(),
                    known: match &value {
                        Value::Message(fields) => fields.iter().map(|(name, _)| (*name).to_owned()).collect(),
                        _ => Vec::new(),
                    },
                })?,
                (&Step::Element(element), Value::Array(array)) => array
                    .element(element)
                    .ok_or_else(|| PathError::NoElement { within: within(), element, length: array.len() })?,
                (Step::Element(_), _) => return Err(PathError::NoArray(within())),
            };
        }
        Ok(value)
    }
}

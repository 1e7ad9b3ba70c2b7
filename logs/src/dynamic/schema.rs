//! The schema of a message type, with the types that it uses.

use super::definition::{Count, FieldLine, MOST_FIELDS, Primitive, TypeName, fields};
use crate::schemas::{full_type_name, schema_text};
use gridweave_runtime::message::Channel;
use std::collections::{BTreeMap, BTreeSet};

/// The maximum nesting of types. Those of ROS are nested about 6 deep.
const DEEPEST: usize = 64;

/// The maximum length of a definition with those of all types that it uses, bytes. Those of ROS have some ten thousand.
const LONGEST: usize = 1 << 20;

/// A message type, with all types that it uses.
#[derive(Clone, Debug)]
pub struct Schema {
    /// Each type comes after those that it uses.
    pub(super) types: Vec<MessageType>,
}

/// One type of a schema.
#[derive(Clone, Debug)]
pub(super) struct MessageType {
    /// `package/Type`.
    pub(super) name: String,
    pub(super) fields: Vec<Field>,
    /// The minimum encoded size of a value, at least 1 byte.
    pub(super) least_size: usize,
}

/// A field of a type.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) of: Element,
    /// The maximum length of a string, if bounded.
    pub(super) text_bound: Option<usize>,
    pub(super) count: Count,
}

/// The type of a field or of its elements.
#[derive(Clone, Copy, Debug)]
pub(super) enum Element {
    Primitive(Primitive),
    /// An index into the schema's types.
    Message(usize),
}

/// The error when messages of a type cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// The messages or the schema have an unsupported encoding.
    #[error("{what} is encoded as `{found}`; only `{expected}` is supported")]
    Encoding {
        /// The message or the schema.
        what: &'static str,
        /// Its encoding.
        found: String,
        /// The supported encoding.
        expected: &'static str,
    },
    /// There is no definition of the type.
    #[error("there is no definition of {0}")]
    Undefined(String),
    /// A line of a definition is invalid.
    #[error("the definition of {name} has the invalid line `{line}`")]
    Line {
        /// The type.
        name: String,
        /// The line.
        line: String,
    },
    /// A type has two fields with the same name, which would be ambiguous.
    #[error("the definition of {name} has two fields named `{field}`")]
    Twice {
        /// The type.
        name: String,
        /// The name.
        field: String,
    },
    /// A type and those that it uses have too many fields.
    #[error("the definition of {0} has more than {MOST_FIELDS} fields with those of the types in it")]
    ManyFields(String),
    /// A definition is too long.
    #[error("the definition of {name} has {length} bytes, and at most {LONGEST} are read")]
    Long {
        /// The type.
        name: String,
        /// The length of its definition.
        length: usize,
    },
    /// A type contains itself, or types are nested too deeply.
    #[error("the definition of {0} contains itself, or is nested too deeply")]
    Nested(String),
}

impl Schema {
    /// The schema of a channel's messages. If the channel has none, the built-in definition of the type is used.
    pub fn of_channel(channel: &Channel) -> Result<Self, SchemaError> {
        let check = |what, found: &str, expected| match found == expected {
            true => Ok(()),
            false => Err(SchemaError::Encoding { what, found: found.to_owned(), expected }),
        };
        check("the message", &channel.message_encoding, "cdr")?;
        if channel.schema.is_empty() {
            let name = if channel.schema_name.is_empty() { "the type" } else { &channel.schema_name };
            let text = schema_text(&channel.schema_name).ok_or_else(|| SchemaError::Undefined(name.to_owned()))?;
            return Self::parse(&channel.schema_name, &text);
        }
        check("the schema", &channel.schema_encoding, "ros2msg")?;
        Self::parse(&channel.schema_name, &String::from_utf8_lossy(&channel.schema))
    }

    /// Parses the schema of the type `name` (`package/msg/Type`): its definition and then, each after a line of `=` and
    /// a line `MSG: package/Type`, the definitions of all types that it uses.
    pub fn parse(name: &str, text: &str) -> Result<Self, SchemaError> {
        if text.len() > LONGEST {
            return Err(SchemaError::Long { name: name.to_owned(), length: text.len() });
        }
        let sections = sections(name, text);
        let mut builder = Builder { sections, done: BTreeMap::new(), types: Vec::new(), field_count: 0 };
        builder.add(&short_name(name), 0)?;
        Ok(Self { types: builder.types })
    }

    /// The type of the message.
    pub(super) fn root(&self) -> Option<&MessageType> {
        self.types.last()
    }

    /// The minimum encoded size of a value, bytes.
    pub(super) fn least_size(&self, of: Element) -> usize {
        match of {
            Element::Primitive(primitive) => primitive.least_size(),
            Element::Message(index) => self.types.get(index).map_or(1, |of| of.least_size),
        }
    }
}

/// The definitions in the schema of the type `name`, by `package/Type`.
pub(crate) fn sections(name: &str, text: &str) -> BTreeMap<String, String> {
    let mut sections = BTreeMap::new();
    let mut section = (short_name(name), String::new());
    let mut starts = false;
    for line in text.lines() {
        if is_separator(line) {
            starts = true;
        } else if let Some(name) = line.trim().strip_prefix("MSG:").filter(|_| starts) {
            let (done, text) = std::mem::replace(&mut section, (short_name(name.trim()), String::new()));
            sections.entry(done).or_insert(text);
            starts = false;
        } else {
            section.1.push_str(line);
            section.1.push('\n');
        }
    }
    sections.entry(section.0).or_insert(section.1);
    sections
}

fn is_separator(line: &str) -> bool {
    let line = line.trim();
    line.len() >= 3 && line.bytes().all(|byte| byte == b'=')
}

/// `package/Type`.
fn short_name(name: &str) -> String {
    full_type_name(name).replacen("/msg/", "/", 1)
}

/// The definition of a type that some programs treat as built-in, so that their logs lack it.
fn built_in(name: &str) -> Option<&'static str> {
    match name {
        "builtin_interfaces/Time" | "builtin_interfaces/Duration" => Some("int32 sec\nuint32 nanosec"),
        _ => None,
    }
}

/// Builds the types of a schema, each after those that it uses.
struct Builder {
    sections: BTreeMap<String, String>,
    done: BTreeMap<String, usize>,
    types: Vec<MessageType>,
    field_count: usize,
}

impl Builder {
    /// Adds the type and all that it uses; returns its index.
    fn add(&mut self, name: &str, depth: usize) -> Result<usize, SchemaError> {
        if let Some(&index) = self.done.get(name) {
            return Ok(index);
        }
        if depth > DEEPEST {
            return Err(SchemaError::Nested(name.to_owned()));
        }
        let text = self.sections.get(name).map(String::as_str).or_else(|| built_in(name));
        let lines = fields(text.ok_or_else(|| SchemaError::Undefined(name.to_owned()))?)
            .map_err(|line| SchemaError::Line { name: name.to_owned(), line })?;
        self.field_count += lines.len();
        if self.field_count > MOST_FIELDS {
            return Err(SchemaError::ManyFields(name.to_owned()));
        }
        let mut made = MessageType { name: name.to_owned(), fields: Vec::with_capacity(lines.len()), least_size: 0 };
        let mut names = BTreeSet::new();
        for FieldLine { name: field, of, text_bound, count } in lines {
            if !names.insert(field.clone()) {
                return Err(SchemaError::Twice { name: name.to_owned(), field });
            }
            let (of, size) = match of {
                TypeName::Primitive(primitive) => (Element::Primitive(primitive), primitive.least_size()),
                TypeName::Message(used) => {
                    let index = self.add(&self.resolve(&used, name), depth + 1)?;
                    (Element::Message(index), self.types[index].least_size)
                }
            };
            let size = match count {
                Count::One => size,
                Count::Fixed(count) => size.saturating_mul(count),
                Count::Any | Count::UpTo(_) => 4,
            };
            made.least_size = made.least_size.saturating_add(size);
            made.fields.push(Field { name: field, of, text_bound, count });
        }
        // A message without fields is one byte, since a structure has at least one member.
        made.least_size = made.least_size.max(1);
        self.types.push(made);
        self.done.insert(name.to_owned(), self.types.len() - 1);
        Ok(self.types.len() - 1)
    }

    /// The full name of a type named in the definition of `user`. A name without a package is in the same package,
    /// except `Header`.
    fn resolve(&self, used: &str, user: &str) -> String {
        if used.contains('/') {
            return short_name(used);
        }
        let package = user.split_once('/').map_or("", |(package, _)| package);
        let own = format!("{package}/{used}");
        match self.sections.contains_key(&own) {
            false if used == "Header" => "std_msgs/Header".to_owned(),
            _ => own,
        }
    }
}

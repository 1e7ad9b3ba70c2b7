//! A decoded message as a tree of values.

use std::fmt;

/// A decoded message, or a part of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    /// A number, a string or a boolean.
    Scalar(Scalar<'a>),
    /// An array of fixed or variable length.
    Array(Array<'a>),
    /// A message: its fields with their names, in the order of the definition.
    Message(Vec<(&'a str, Value<'a>)>),
}

/// A number, a string or a boolean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scalar<'a> {
    /// A boolean.
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer.
    Uint(u64),
    /// A `float32`.
    F32(f32),
    /// A `float64`.
    F64(f64),
    /// A string.
    Text(&'a str),
}

/// The elements of an array, by type.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Array<'a> {
    Bool(Vec<bool>),
    I8(&'a [i8]),
    U8(&'a [u8]),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    Text(Vec<&'a str>),
    /// Each is a [`Value::Message`].
    Messages(Vec<Value<'a>>),
}

impl<'a> Value<'a> {
    /// The field with this name, if the value is a message that has one.
    pub fn field(&self, name: &str) -> Option<&Value<'a>> {
        match self {
            Self::Message(fields) => fields.iter().find(|(field, _)| *field == name).map(|(_, value)| value),
            _ => None,
        }
    }
}

impl<'a> Array<'a> {
    /// The number of elements.
    pub fn len(&self) -> usize {
        match self {
            Self::Bool(list) => list.len(),
            Self::I8(list) => list.len(),
            Self::U8(list) => list.len(),
            Self::I16(list) => list.len(),
            Self::U16(list) => list.len(),
            Self::I32(list) => list.len(),
            Self::U32(list) => list.len(),
            Self::I64(list) => list.len(),
            Self::U64(list) => list.len(),
            Self::F32(list) => list.len(),
            Self::F64(list) => list.len(),
            Self::Text(list) => list.len(),
            Self::Messages(list) => list.len(),
        }
    }

    /// Whether the array is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A scalar element; `None` if the index is out of range or the elements are messages.
    pub fn scalar(&self, at: usize) -> Option<Scalar<'a>> {
        Some(match self {
            Self::Bool(list) => Scalar::Bool(*list.get(at)?),
            Self::I8(list) => Scalar::Int((*list.get(at)?).into()),
            Self::U8(list) => Scalar::Uint((*list.get(at)?).into()),
            Self::I16(list) => Scalar::Int((*list.get(at)?).into()),
            Self::U16(list) => Scalar::Uint((*list.get(at)?).into()),
            Self::I32(list) => Scalar::Int((*list.get(at)?).into()),
            Self::U32(list) => Scalar::Uint((*list.get(at)?).into()),
            Self::I64(list) => Scalar::Int(*list.get(at)?),
            Self::U64(list) => Scalar::Uint(*list.get(at)?),
            Self::F32(list) => Scalar::F32(*list.get(at)?),
            Self::F64(list) => Scalar::F64(*list.get(at)?),
            Self::Text(list) => Scalar::Text(list.get(at)?),
            Self::Messages(_) => return None,
        })
    }

    /// An element of any type.
    pub fn element(&self, at: usize) -> Option<Value<'a>> {
        match self {
            Self::Messages(list) => list.get(at).cloned(),
            _ => self.scalar(at).map(Value::Scalar),
        }
    }
}

impl Scalar<'_> {
    /// The value as a number; `None` for a string. Integers above 2^53 are rounded.
    pub fn as_f64(&self) -> Option<f64> {
        match *self {
            Self::Int(number) => Some(number as f64),
            Self::Uint(number) => Some(number as f64),
            Self::F32(number) => Some(number.into()),
            Self::F64(number) => Some(number),
            Self::Bool(_) | Self::Text(_) => None,
        }
    }
}

impl fmt::Display for Scalar<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Int(number) => write!(f, "{number}"),
            Self::Uint(number) => write!(f, "{number}"),
            Self::F32(number) => write!(f, "{number:?}"),
            Self::F64(number) => write!(f, "{number:?}"),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

impl fmt::Display for Array<'_> {
    /// Shows the elements if they are few, and otherwise their number.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// The maximum number of elements that are shown.
        const LONGEST: usize = 16;
        let scalars = (0..self.len().min(LONGEST)).map_while(|at| self.scalar(at));
        match self.len() {
            1 if matches!(self, Self::Messages(_)) => f.write_str("1 element"),
            length if length > LONGEST || (length > 0 && matches!(self, Self::Messages(_))) => {
                write!(f, "{length} elements")
            }
            _ => write!(f, "[{}]", scalars.map(|scalar| scalar.to_string()).collect::<Vec<_>>().join(", ")),
        }
    }
}

impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scalar(scalar) => scalar.fmt(f),
            Self::Array(array) => array.fmt(f),
            Self::Message(fields) => {
                let fields: Vec<String> = fields.iter().map(|(name, value)| format!("{name}: {value}")).collect();
                write!(f, "{{{}}}", fields.join(", "))
            }
        }
    }
}

//! A decoded message as a tree.

use std::fmt;

/// A decoded message, or a part of one.
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    /// A number, a text or a truth value.
    Scalar(Scalar<'a>),
    /// An array, of fixed length or not.
    Array(Array<'a>),
    /// A message: its fields with their names, in the order of its definition.
    Message(Vec<(&'a str, Value<'a>)>),
}

/// A number, a text or a truth value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scalar<'a> {
    /// A truth value.
    Bool(bool),
    /// A whole number of a type with a sign.
    Int(i64),
    /// A whole number of a type without a sign.
    Uint(u64),
    /// A number of type `float32`.
    F32(f32),
    /// A number of type `float64`.
    F64(f64),
    /// A text.
    Text(&'a str),
}

/// The elements of an array, by their type.
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
    /// Each a [`Value::Message`].
    Messages(Vec<Value<'a>>),
}

impl<'a> Value<'a> {
    /// The field of this name, if it is a message that has one.
    pub fn field(&self, name: &str) -> Option<&Value<'a>> {
        match self {
            Self::Message(fields) => fields.iter().find(|(field, _)| *field == name).map(|(_, value)| value),
            _ => None,
        }
    }
}

impl<'a> Array<'a> {
    /// How many elements there are.
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

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// An element, unless there is none there or the elements are messages.
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

    /// An element of any kind.
    pub fn element(&self, at: usize) -> Option<Value<'a>> {
        match self {
            Self::Messages(list) => list.get(at).cloned(),
            _ => self.scalar(at).map(Value::Scalar),
        }
    }
}

impl Scalar<'_> {
    /// The number; `None` if it is none. Above 2^53 whole numbers are rounded.
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
    /// The elements if they are few, and otherwise how many.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// A longer array is not written out.
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

//! Decoding of messages to values.

use super::definition::{Count, Primitive};
use super::reader::{CdrReader, DecodeFault};
use super::schema::{Element, Field, MessageType, Schema};
use super::value::{Array, Scalar, Value};

/// The maximum number of bytes after the last field: encoders pad the length.
const PADDING: usize = 3;

/// The maximum number of values in a decoded message. A value takes up to a hundred bytes, and a few packed bytes of a
/// log can expand to a message of a gigabyte.
const MOST_VALUES: usize = 1 << 21;

/// The error when a message cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaMismatch {
    /// The bytes do not start with a CDR encapsulation header.
    #[error("the message does not begin with a CDR encapsulation")]
    Encapsulation,
    /// A field does not match the schema.
    #[error("the message does not match its schema: {fault} at `{path}`")]
    Field {
        /// The path of the field, such as `tags[3].tag_id`.
        path: String,
        /// The fault.
        fault: DecodeFault,
    },
    /// The message is longer than its fields.
    #[error("the message does not match its schema: {0} bytes are left after its last field")]
    Rest(usize),
}

/// A fault, and the path to it from the inside out.
struct Fault {
    path: Vec<String>,
    fault: DecodeFault,
}

impl From<DecodeFault> for Fault {
    fn from(fault: DecodeFault) -> Self {
        Self { path: Vec::new(), fault }
    }
}

impl Fault {
    fn within(mut self, part: String) -> Self {
        self.path.push(part);
        self
    }

    fn path(&self) -> String {
        let parts: Vec<&str> = self.path.iter().rev().map(String::as_str).collect();
        parts.join(".").replace(".[", "[")
    }
}

impl Schema {
    /// Decodes a message. Strings and byte arrays are borrowed from it, and field names from the schema.
    pub fn decode<'a>(&'a self, bytes: &'a [u8]) -> Result<Value<'a>, SchemaMismatch> {
        let mut reader = CdrReader::new(bytes).ok_or(SchemaMismatch::Encapsulation)?;
        reader.limit_values(MOST_VALUES);
        let Some(root) = self.root() else { return Ok(Value::Message(Vec::new())) };
        let value = self
            .message(root, &mut reader)
            .map_err(|fault| SchemaMismatch::Field { path: fault.path(), fault: fault.fault })?;
        match reader.left() {
            0..=PADDING => Ok(value),
            rest => Err(SchemaMismatch::Rest(rest)),
        }
    }

    fn message<'a>(&'a self, of: &'a MessageType, reader: &mut CdrReader<'a>) -> Result<Value<'a>, Fault> {
        if of.fields.is_empty() {
            reader.bytes(1)?;
        }
        let field = |field: &'a Field| match self.field(field, reader) {
            Ok(value) => Ok((field.name.as_str(), value)),
            Err(fault) => Err(fault.within(field.name.clone())),
        };
        Ok(Value::Message(of.fields.iter().map(field).collect::<Result<_, _>>()?))
    }

    fn field<'a>(&'a self, field: &'a Field, reader: &mut CdrReader<'a>) -> Result<Value<'a>, Fault> {
        reader.count_values(1)?;
        let count = match field.count {
            Count::One => return self.one(field.of, reader),
            Count::Fixed(count) => count,
            Count::Any | Count::UpTo(_) => reader.number::<4, u32>()? as usize,
        };
        // Checked first, so that a corrupt length allocates nothing.
        match self.least_size(field.of).checked_mul(count) {
            Some(size) if size <= reader.left() => self.array(field.of, count, reader).map(Value::Array),
            _ => Err(DecodeFault::Count(count).into()),
        }
    }

    fn one<'a>(&'a self, of: Element, reader: &mut CdrReader<'a>) -> Result<Value<'a>, Fault> {
        let primitive = match of {
            Element::Primitive(primitive) => primitive,
            Element::Message(index) => return self.message(&self.types[index], reader),
        };
        Ok(Value::Scalar(match primitive {
            Primitive::Bool => Scalar::Bool(reader.boolean()?),
            Primitive::I8 => Scalar::Int(reader.number::<1, i8>()?.into()),
            Primitive::U8 | Primitive::Byte => Scalar::Uint(reader.number::<1, u8>()?.into()),
            Primitive::I16 => Scalar::Int(reader.number::<2, i16>()?.into()),
            Primitive::U16 => Scalar::Uint(reader.number::<2, u16>()?.into()),
            Primitive::I32 => Scalar::Int(reader.number::<4, i32>()?.into()),
            Primitive::U32 => Scalar::Uint(reader.number::<4, u32>()?.into()),
            Primitive::I64 => Scalar::Int(reader.number::<8, i64>()?),
            Primitive::U64 => Scalar::Uint(reader.number::<8, u64>()?),
            Primitive::F32 => Scalar::F32(reader.number::<4, f32>()?),
            Primitive::F64 => Scalar::F64(reader.number::<8, f64>()?),
            Primitive::Text => Scalar::Text(reader.text()?),
            Primitive::WideText => return Err(DecodeFault::WideText.into()),
        }))
    }

    fn array<'a>(&'a self, of: Element, count: usize, reader: &mut CdrReader<'a>) -> Result<Array<'a>, Fault> {
        let primitive = match of {
            Element::Primitive(primitive) => primitive,
            Element::Message(index) => {
                let of = &self.types[index];
                reader.count_values(count)?;
                let element = |at| self.message(of, reader).map_err(|fault| fault.within(format!("[{at}]")));
                return Ok(Array::Messages((0..count).map(element).collect::<Result<_, _>>()?));
            }
        };
        Ok(match primitive {
            Primitive::Bool => Array::Bool((0..count).map(|_| reader.boolean()).collect::<Result<_, _>>()?),
            Primitive::I8 => Array::I8(bytemuck::cast_slice(reader.bytes(count)?)),
            Primitive::U8 | Primitive::Byte => Array::U8(reader.bytes(count)?),
            Primitive::I16 => Array::I16(reader.numbers(count)?),
            Primitive::U16 => Array::U16(reader.numbers(count)?),
            Primitive::I32 => Array::I32(reader.numbers(count)?),
            Primitive::U32 => Array::U32(reader.numbers(count)?),
            Primitive::I64 => Array::I64(reader.numbers(count)?),
            Primitive::U64 => Array::U64(reader.numbers(count)?),
            Primitive::F32 => Array::F32(reader.numbers(count)?),
            Primitive::F64 => Array::F64(reader.numbers(count)?),
            Primitive::Text => {
                reader.count_values(count)?;
                let element = |at| reader.text().map_err(|fault| Fault::from(fault).within(format!("[{at}]")));
                Array::Text((0..count).map(element).collect::<Result<_, _>>()?)
            }
            Primitive::WideText => return Err(DecodeFault::WideText.into()),
        })
    }
}

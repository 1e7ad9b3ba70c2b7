//! Conversion of messages from CDR to the encoding of ROS 1.

use super::decode::SchemaMismatch;
use super::definition::{Count, Primitive};
use super::reader::{CdrReader, DecodeFault};
use super::schema::{Element, Field, MessageType, Schema};

/// The type with an additional first field in ROS 1: `uint32 seq`.
const HEADER: &str = "std_msgs/Header";

/// Converts messages of one type from CDR to the encoding of ROS 1: little-endian, without alignment, and without zero
/// bytes after strings.
#[derive(Clone, Debug)]
pub(crate) struct Ros1Encoder {
    schema: Schema,
    /// For each field of each type, whether ROS 1 lacks it.
    left_out: Vec<Vec<bool>>,
}

impl Ros1Encoder {
    /// Creates a converter for messages of a schema, without the fields for which `is_left_out` holds; it is given the
    /// type (`package/Type`) and the field. `None` if there are `wstring` fields, which ROS 1 does not have.
    pub(crate) fn new(schema: Schema, is_left_out: impl Fn(&str, &str) -> bool) -> Option<Self> {
        let left_out = |of: &MessageType| of.fields.iter().map(|field| is_left_out(&of.name, &field.name)).collect();
        let left_out: Vec<Vec<bool>> = schema.types.iter().map(left_out).collect();
        let is_wide = |field: &Field| matches!(field.of, Element::Primitive(Primitive::WideText));
        let has_wide = schema.types.iter().flat_map(|of| &of.fields).any(is_wide);
        (!has_wide).then_some(Self { schema, left_out })
    }

    /// Appends a message (CDR) to `out` in the encoding of ROS 1. Its headers have the number `sequence`.
    ///
    /// # Errors
    /// The message does not match its schema. `out` is unchanged.
    pub(crate) fn append(&self, message: &[u8], sequence: u32, out: &mut Vec<u8>) -> Result<(), SchemaMismatch> {
        let mut reader = CdrReader::new(message).ok_or(SchemaMismatch::Encapsulation)?;
        let Some(root) = self.schema.types.len().checked_sub(1) else { return Ok(()) };
        let begin = out.len();
        out.reserve(message.len() + 16);
        self.message(root, sequence, &mut reader, &mut Some(&mut *out)).map_err(|(path, fault)| {
            out.truncate(begin);
            SchemaMismatch::Field { path, fault }
        })
    }

    /// Copies a message; nothing is written if `out` is `None`.
    fn message(&self, index: usize, sequence: u32, reader: &mut CdrReader<'_>, out: Out<'_, '_>) -> Result<(), Fault> {
        let end = || (String::new(), DecodeFault::End);
        let of = self.schema.types.get(index).ok_or_else(end)?;
        if of.name == HEADER {
            put(out, &sequence.to_le_bytes());
        }
        if of.fields.is_empty() {
            // A message without fields is one byte in CDR, and nothing in ROS 1.
            reader.bytes(1).map_err(|fault| (of.name.clone(), fault))?;
        }
        for (place, field) in of.fields.iter().enumerate() {
            let is_left_out = self.left_out.get(index).and_then(|fields| fields.get(place)) == Some(&true);
            let copied = match is_left_out {
                true => self.field(field, sequence, reader, &mut None),
                false => self.field(field, sequence, reader, out),
            };
            copied?;
        }
        Ok(())
    }

    fn field(&self, field: &Field, sequence: u32, reader: &mut CdrReader<'_>, out: Out<'_, '_>) -> Result<(), Fault> {
        let own = |fault| (field.name.clone(), fault);
        let count = match field.count {
            Count::One => 1,
            Count::Fixed(count) => count,
            Count::Any | Count::UpTo(_) => {
                let count = reader.number::<4, u32>().map_err(own)?;
                put(out, &count.to_le_bytes());
                count as usize
            }
        };
        // Checked first, so that a corrupt length copies nothing.
        let least = self.schema.least_size(field.of).checked_mul(count);
        if field.count != Count::One && least.is_none_or(|least| least > reader.left()) {
            return Err(own(DecodeFault::Count(count)));
        }
        match field.of {
            Element::Message(index) => (0..count).try_for_each(|_| self.message(index, sequence, reader, out)),
            Element::Primitive(Primitive::Text | Primitive::WideText) => (0..count).try_for_each(|_| {
                let text = reader.text_bytes().map_err(own)?;
                put(out, &u32::try_from(text.len()).unwrap_or(u32::MAX).to_le_bytes());
                put(out, text);
                Ok(())
            }),
            Element::Primitive(_) if count == 0 => Ok(()),
            Element::Primitive(primitive) => {
                let size = primitive.least_size();
                reader.align(size);
                let length = size.checked_mul(count).ok_or_else(|| own(DecodeFault::Count(count)))?;
                let numbers = reader.bytes(length).map_err(own)?;
                match reader.is_big_endian() {
                    false => put(out, numbers),
                    true => numbers.chunks_exact(size).for_each(|number| {
                        let little: Vec<u8> = number.iter().rev().copied().collect();
                        put(out, &little);
                    }),
                }
                Ok(())
            }
        }
    }
}

/// The target of a copy, if the field has one.
type Out<'a, 'b> = &'a mut Option<&'b mut Vec<u8>>;

/// The field that could not be copied, and the fault.
type Fault = (String, DecodeFault);

fn put(out: Out<'_, '_>, bytes: &[u8]) {
    if let Some(out) = out {
        out.extend_from_slice(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamic::Recoder;

    const DEFINITION: &str = "\
bool flag
std_msgs/Header header
float64[] numbers
string<=9[2] names
int64 left_out
p/Empty empty
p/Part[<=3] parts
================================================================================
MSG: p/Empty
================================================================================
MSG: p/Part
int16 a
string b
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
";

    /// A message in CDR, of either byte order.
    fn cdr(big_endian: bool) -> Vec<u8> {
        struct Bytes(Vec<u8>, bool);
        impl Bytes {
            fn number(&mut self, little: &[u8]) {
                self.0.resize((self.0.len() - 4).next_multiple_of(little.len()) + 4, 0);
                let bytes: Vec<u8> = if self.1 { little.iter().rev().copied().collect() } else { little.to_vec() };
                self.0.extend(bytes);
            }
            fn text(&mut self, text: &str) {
                self.number(&(text.len() as u32 + 1).to_le_bytes());
                self.0.extend(text.bytes().chain([0]));
            }
        }
        let mut bytes = Bytes(vec![0, u8::from(!big_endian), 0, 0], big_endian);
        bytes.number(&[1]);
        bytes.number(&7_i32.to_le_bytes());
        bytes.number(&9_u32.to_le_bytes());
        bytes.text("map");
        bytes.number(&2_u32.to_le_bytes());
        [1.5_f64, -2.5].iter().for_each(|number| bytes.number(&number.to_le_bytes()));
        ["a", ""].iter().for_each(|text| bytes.text(text));
        bytes.number(&77_i64.to_le_bytes());
        bytes.number(&[0]);
        bytes.number(&1_u32.to_le_bytes());
        bytes.number(&(-3_i16).to_le_bytes());
        bytes.text("bc");
        bytes.0
    }

    fn encoder() -> Ros1Encoder {
        let schema = Schema::parse("p/All", DEFINITION).unwrap();
        Ros1Encoder::new(schema, |of, field| (of, field) == ("p/All", "left_out")).unwrap()
    }

    #[test]
    fn fields_are_written_without_gaps_and_headers_with_a_number() {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
        let expected = [
            vec![1],
            [5_u32, 7, 9].map(u32::to_le_bytes).concat(),
            text("map"),
            2_u32.to_le_bytes().to_vec(),
            [1.5_f64, -2.5].map(f64::to_le_bytes).concat(),
            text("a"),
            text(""),
            1_u32.to_le_bytes().to_vec(),
            (-3_i16).to_le_bytes().to_vec(),
            text("bc"),
        ]
        .concat();
        for big_endian in [false, true] {
            let mut out = b"before".to_vec();
            encoder().append(&cdr(big_endian), 5, &mut out).unwrap();
            assert_eq!(out, [b"before", &expected[..]].concat(), "{big_endian}");
        }
        // The way back.
        let without = DEFINITION.replace("int64 left_out\n", "");
        let recoder = Recoder::new(Schema::parse("p/All", &without).unwrap()).unwrap();
        let (mut back, mut again) = (Vec::new(), Vec::new());
        recoder.append_ros1(&expected, &mut back).unwrap();
        let same = Ros1Encoder::new(Schema::parse("p/All", &without).unwrap(), |_, _| false).unwrap();
        same.append(&back, 5, &mut again).unwrap();
        assert_eq!(again, expected);
    }

    #[test]
    fn a_message_that_does_not_match_is_an_error_and_writes_nothing() {
        let whole = cdr(false);
        for length in 0..whole.len() {
            let mut out = Vec::new();
            assert!(encoder().append(&whole[..length], 0, &mut out).is_err(), "{length}");
            assert!(out.is_empty(), "{length}");
        }
        let wide = Schema::parse("p/Wide", "wstring text").unwrap();
        assert!(Ros1Encoder::new(wide, |_, _| false).is_none());
    }
}

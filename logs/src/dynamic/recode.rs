//! Copying of messages field by field: with renamed frames, or converted from ROS 1.

use super::decode::SchemaMismatch;
use super::definition::{Count, Primitive};
use super::reader::{CdrReader, DecodeFault};
use super::schema::{Element, Field, MessageType, Schema};
use std::borrow::Cow;

/// The encapsulation headers of plain CDR; the first two bytes are the byte order.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
const BIG_ENDIAN: [u8; 4] = [0, 0, 0, 0];

/// The type with an additional first field in ROS 1: `uint32 seq`.
const HEADER: &str = "std_msgs/Header";
const SEQ_SIZE: usize = 4;
const TIME: &str = "builtin_interfaces/Time";
const SECOND: u64 = 1_000_000_000;
/// The maximum length of a converted message, bytes. A ROS 1 message without fields takes no bytes, and one in CDR.
const LONGEST: usize = 1 << 30;

/// Copies messages of one type, field by field.
#[derive(Clone, Debug)]
pub struct Recoder {
    schema: Schema,
}

impl Recoder {
    /// Creates a copier for messages of a schema. `None` if it has `wstring` fields, which cannot be copied.
    pub fn new(schema: Schema) -> Option<Self> {
        let is_wide = |field: &Field| matches!(field.of, Element::Primitive(Primitive::WideText));
        let is_copied = !schema.types.iter().flat_map(|of| &of.fields).any(is_wide);
        is_copied.then_some(Self { schema })
    }

    /// Whether messages contain frames: strings in fields named `frame_id` or with that suffix, such as
    /// `child_frame_id`.
    pub fn names_frames(&self) -> bool {
        self.schema.types.iter().flat_map(|of| &of.fields).any(is_frame)
    }

    /// Whether messages contain header stamps.
    pub fn has_stamps(&self) -> bool {
        self.schema.types.iter().any(|of| of.name == HEADER)
    }

    /// Appends a message (CDR) to `copy`, with frames renamed by `rename`, and header stamps shifted `later` by
    /// nanoseconds (earlier if negative). Returns `false`, and appends nothing, if nothing changes. A zero stamp is "no
    /// time", and is not shifted.
    ///
    /// # Errors
    /// The message does not match its schema. `copy` is unchanged.
    pub fn rename_frames(
        &self,
        message: &[u8],
        rename: &dyn Fn(&str) -> Cow<'_, str>,
        later: i64,
        copy: &mut Vec<u8>,
    ) -> Result<bool, SchemaMismatch> {
        let reader = || CdrReader::new(message).ok_or(SchemaMismatch::Encapsulation);
        // Most messages contain few frames, and are long.
        if !self.walk(reader()?, rename, later, None)? {
            return Ok(false);
        }
        self.walk(reader()?, rename, later, Some(copy))
    }

    /// Appends a ROS 1 message to `copy` as little-endian CDR. The schema is that of ROS 2, in which a header has no
    /// `seq`.
    ///
    /// # Errors
    /// The message does not match its schema. `copy` is unchanged.
    pub fn append_ros1(&self, message: &[u8], copy: &mut Vec<u8>) -> Result<(), SchemaMismatch> {
        self.walk(CdrReader::ros1(message), &|frame| Cow::Borrowed(frame), 0, Some(copy)).map(|_| ())
    }

    /// Walks over the fields, and appends them to `copy` if given. Returns whether anything changed.
    fn walk(
        &self,
        mut reader: CdrReader<'_>,
        rename: &dyn Fn(&str) -> Cow<'_, str>,
        later: i64,
        mut copy: Option<&mut Vec<u8>>,
    ) -> Result<bool, SchemaMismatch> {
        let big_endian = reader.is_big_endian();
        let begin = copy.as_ref().map_or(0, |copy| copy.len());
        if let Some(copy) = &mut copy {
            copy.reserve(reader.left() + 64);
            copy.extend_from_slice(if big_endian { &BIG_ENDIAN } else { &LITTLE_ENDIAN });
        }
        let body = copy.as_ref().map_or(0, |copy| copy.len());
        let mut walk = Walk { schema: &self.schema, rename, later, is_renamed: false };
        let mut writer = Writer { bytes: copy, body, big_endian };
        let Some(root) = self.schema.root() else { return Ok(false) };
        walk.message(root, &mut reader, &mut writer).map_err(|(path, fault)| {
            if let Some(copy) = writer.bytes {
                copy.truncate(begin);
            }
            SchemaMismatch::Field { path, fault }
        })?;
        Ok(walk.is_renamed)
    }
}

fn is_frame(field: &Field) -> bool {
    matches!(field.of, Element::Primitive(Primitive::Text)) && field.name.ends_with("frame_id")
}

/// The field that could not be copied, and the fault.
type Fault = (String, DecodeFault);

struct Walk<'a> {
    schema: &'a Schema,
    rename: &'a dyn Fn(&str) -> Cow<'_, str>,
    later: i64,
    is_renamed: bool,
}

impl Walk<'_> {
    fn message(&mut self, of: &MessageType, reader: &mut CdrReader<'_>, writer: &mut Writer<'_>) -> Result<(), Fault> {
        let own = |fault| (of.name.clone(), fault);
        if reader.is_ros1() && of.name == HEADER {
            reader.bytes(SEQ_SIZE).map_err(own)?;
        }
        if writer.length() > LONGEST {
            return Err(own(DecodeFault::Long(LONGEST)));
        }
        if of.fields.is_empty() {
            // A message without fields is one byte in CDR, and nothing in ROS 1.
            if !reader.is_ros1() {
                reader.bytes(1).map_err(own)?;
            }
            writer.put(&[0]);
        }
        of.fields.iter().try_for_each(|field| self.field(field, reader, writer))
    }

    fn field(&mut self, field: &Field, reader: &mut CdrReader<'_>, writer: &mut Writer<'_>) -> Result<(), Fault> {
        let own = |fault| (field.name.clone(), fault);
        reader.count_values(1).map_err(own)?;
        let count = match field.count {
            Count::One => 1,
            Count::Fixed(count) => count,
            Count::Any | Count::UpTo(_) => {
                let count = reader.number::<4, u32>().map_err(own)?;
                writer.u32(count);
                count as usize
            }
        };
        // Checked first, so that a corrupt length copies nothing.
        let least = self.schema.least_size(field.of).checked_mul(count);
        if field.count != Count::One && least.is_none_or(|least| least > reader.left()) {
            return Err(own(DecodeFault::Count(count)));
        }
        match field.of {
            Element::Message(index) => {
                let schema = self.schema;
                let of = schema.types.get(index).ok_or_else(|| own(DecodeFault::End))?;
                if self.later != 0 && field.name == "stamp" && of.name == TIME && field.count == Count::One {
                    return self.stamp(reader, writer).map_err(own);
                }
                if field.count != Count::One {
                    reader.count_values(count).map_err(own)?;
                }
                (0..count).try_for_each(|_| self.message(of, reader, writer))
            }
            Element::Primitive(Primitive::Text) if is_frame(field) => (0..count).try_for_each(|_| {
                let frame = reader.text().map_err(own)?;
                let renamed = (self.rename)(frame);
                self.is_renamed |= renamed != frame;
                writer.text(renamed.as_bytes());
                Ok(())
            }),
            Element::Primitive(Primitive::Text) => (0..count).try_for_each(|_| {
                writer.text(reader.text_bytes().map_err(own)?);
                Ok(())
            }),
            Element::Primitive(Primitive::WideText) => Err(own(DecodeFault::WideText)),
            Element::Primitive(_) if count == 0 => Ok(()),
            Element::Primitive(primitive) => {
                let size = primitive.least_size();
                reader.align(size);
                let length = size.checked_mul(count).ok_or_else(|| own(DecodeFault::Count(count)))?;
                let numbers = reader.bytes(length).map_err(own)?;
                writer.align(size);
                writer.put(numbers);
                Ok(())
            }
        }
    }

    /// Copies a stamp, shifted.
    fn stamp(&mut self, reader: &mut CdrReader<'_>, writer: &mut Writer<'_>) -> Result<(), DecodeFault> {
        let (seconds, nanoseconds) = (reader.number::<4, u32>()?, reader.number::<4, u32>()?);
        let moved = match (seconds, nanoseconds) {
            (0, 0) => (0, 0),
            // Seconds are signed, but no log is from before 1970.
            _ => {
                let time = u64::from(seconds) * SECOND + u64::from(nanoseconds);
                let moved = time.saturating_add_signed(self.later);
                (u32::try_from(moved / SECOND).unwrap_or(u32::MAX), (moved % SECOND) as u32)
            }
        };
        self.is_renamed |= moved != (seconds, nanoseconds);
        writer.u32(moved.0);
        writer.u32(moved.1);
        Ok(())
    }
}

/// Appends fields in CDR, if there is a target.
struct Writer<'a> {
    bytes: Option<&'a mut Vec<u8>>,
    /// The start of the fields; alignment is relative to it.
    body: usize,
    big_endian: bool,
}

impl Writer<'_> {
    /// The number of bytes of the fields so far.
    fn length(&self) -> usize {
        self.bytes.as_ref().map_or(0, |copy| copy.len() - self.body)
    }

    fn put(&mut self, bytes: &[u8]) {
        if let Some(copy) = &mut self.bytes {
            copy.extend_from_slice(bytes);
        }
    }

    fn align(&mut self, size: usize) {
        if let Some(copy) = &mut self.bytes {
            let at = (copy.len() - self.body).next_multiple_of(size);
            copy.resize(self.body + at, 0);
        }
    }

    fn u32(&mut self, number: u32) {
        self.align(4);
        self.put(&if self.big_endian { number.to_be_bytes() } else { number.to_le_bytes() });
    }

    fn text(&mut self, text: &[u8]) {
        // A longer string does not fit into a message.
        self.u32(u32::try_from(text.len() + 1).unwrap_or(u32::MAX));
        self.put(text);
        self.put(&[0]);
    }
}

//! The parts of a message of RTPS (2.3, 8.3 and 9.4), as they are read.

use super::cursor::Cursor;
use super::guid::{EntityId, Prefix};
use super::number_set::NumberSet;

/// The first bytes of a message: `RTPS`, and version 2.
const MAGIC: &[u8] = b"RTPS\x02";

/// A part of a message, with its sender and its receiver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Submessage<'a> {
    pub(crate) source: Prefix,
    /// [`Prefix::UNKNOWN`] for everybody.
    pub(crate) destination: Prefix,
    /// When it was published, nanoseconds since the Unix epoch.
    pub(crate) published: Option<i64>,
    pub(crate) reader: EntityId,
    pub(crate) writer: EntityId,
    pub(crate) body: Body<'a>,
}

/// What a part of a message says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Body<'a> {
    /// A sample. `inline` has parameters beside it, whose values are little-endian if `is_little`; `payload` is its key
    /// alone if `is_key`.
    Data { sequence: i64, inline: &'a [u8], is_little: bool, is_key: bool, payload: &'a [u8] },
    /// Consecutive fragments of a sample, `count` of them, the first with the number `first` (from 1).
    Fragments { sequence: i64, first: u32, count: u16, fragment_size: u16, sample_size: u32, payload: &'a [u8] },
    /// What a writer has: samples from `first` to `last`.
    Heartbeat { first: i64, last: i64, count: u32, is_final: bool },
    /// What a reader has, and asks for.
    AckNack { missing: NumberSet, count: u32, is_final: bool },
    /// The fragments of a sample that a reader asks for.
    NackFragments { sequence: i64, missing: NumberSet, count: u32 },
    /// Samples that do not come: from `start` to the one before the set's base, and those in the set.
    Gap { start: i64, set: NumberSet },
}

/// The parts of a message that say something to an endpoint. A part that is not understood is left out, and so is all
/// after one that is broken.
pub(crate) fn submessages(message: &[u8]) -> Vec<Submessage<'_>> {
    let mut parts = Vec::new();
    let Some(source) = message.strip_prefix(MAGIC).and_then(|rest| rest.get(3..15)) else { return parts };
    let Ok(source) = source.try_into() else { return parts };
    let mut context = Context { source: Prefix(source), destination: Prefix::UNKNOWN, published: None };
    let mut at = 20;
    while let Some((&[kind, flags, a, b], rest)) = message.get(at..).and_then(|rest| rest.split_first_chunk()) {
        let is_little = flags & 1 != 0;
        let stated = if is_little { u16::from_le_bytes([a, b]) } else { u16::from_be_bytes([a, b]) };
        // The last one may have no length: it goes on to the end. Padding and times may be empty.
        let length = match stated {
            0 if kind != PAD && kind != INFO_TIMESTAMP => rest.len(),
            stated => usize::from(stated),
        };
        let Some(body) = rest.get(..length) else { return parts };
        if context.note(kind, flags, body).is_none() {
            return parts;
        }
        parts.extend(read(kind, flags, body).map(|(reader, writer, body)| {
            let Context { source, destination, published } = context;
            Submessage { source, destination, published, reader, writer, body }
        }));
        at += 4 + length;
    }
    parts
}

/// The sender, receiver and time that parts set for the later ones.
struct Context {
    source: Prefix,
    destination: Prefix,
    published: Option<i64>,
}

const PAD: u8 = 0x01;
const ACKNACK: u8 = 0x06;
const HEARTBEAT: u8 = 0x07;
const GAP: u8 = 0x08;
const INFO_TIMESTAMP: u8 = 0x09;
const INFO_SOURCE: u8 = 0x0c;
const INFO_DESTINATION: u8 = 0x0e;
const NACK_FRAGMENTS: u8 = 0x12;
const DATA: u8 = 0x15;
const FRAGMENTS: u8 = 0x16;

impl Context {
    fn note(&mut self, kind: u8, flags: u8, body: &[u8]) -> Option<()> {
        let mut cursor = Cursor::new(body, flags & 1 != 0);
        match kind {
            INFO_TIMESTAMP if flags & 2 != 0 => self.published = None,
            INFO_TIMESTAMP => {
                let (seconds, fraction) = (i64::from(cursor.u32()?), i64::from(cursor.u32()?));
                self.published = Some(seconds * 1_000_000_000 + ((fraction * 1_000_000_000) >> 32));
            }
            INFO_SOURCE => {
                cursor.take(8)?;
                *self = Self { source: Prefix(cursor.array()?), destination: self.destination, published: None };
            }
            INFO_DESTINATION => self.destination = Prefix(cursor.array()?),
            _ => {}
        }
        Some(())
    }
}

fn read(kind: u8, flags: u8, body: &[u8]) -> Option<(EntityId, EntityId, Body<'_>)> {
    let is_little = flags & 1 != 0;
    let has = |flag: u8| flags & flag != 0;
    let mut cursor = Cursor::new(body, is_little);
    match kind {
        DATA | FRAGMENTS => {
            cursor.u16()?;
            let to_parameters = usize::from(cursor.u16()?);
            // From here on it counts; newer versions may have more before the parameters.
            let after = cursor.rest().get(to_parameters..)?;
            let (reader, writer, sequence) = entities_and_sequence(&mut cursor)?;
            let (first, count, fragment_size, sample_size) = match kind {
                DATA => (0, 0, 0, 0),
                _ => (cursor.u32()?, cursor.u16()?, cursor.u16()?, cursor.u32()?),
            };
            let inline_size = if has(2) { super::parameters::size(after, is_little)? } else { 0 };
            let (inline, payload) = after.split_at_checked(inline_size)?;
            let body = match kind {
                DATA => {
                    let payload = if has(4) || has(8) { payload } else { &[] };
                    Body::Data { sequence, inline, is_little, is_key: has(8), payload }
                }
                _ => Body::Fragments { sequence, first, count, fragment_size, sample_size, payload },
            };
            Some((reader, writer, body))
        }
        HEARTBEAT => {
            let (reader, writer, first) = entities_and_sequence(&mut cursor)?;
            let body = Body::Heartbeat { first, last: cursor.sequence()?, count: cursor.u32()?, is_final: has(2) };
            Some((reader, writer, body))
        }
        ACKNACK => {
            let (reader, writer) = entities(&mut cursor)?;
            let missing = NumberSet::read_sequences(&mut cursor)?;
            Some((reader, writer, Body::AckNack { missing, count: cursor.u32()?, is_final: has(2) }))
        }
        NACK_FRAGMENTS => {
            let (reader, writer, sequence) = entities_and_sequence(&mut cursor)?;
            let missing = NumberSet::read_fragments(&mut cursor)?;
            Some((reader, writer, Body::NackFragments { sequence, missing, count: cursor.u32()? }))
        }
        GAP => {
            let (reader, writer, start) = entities_and_sequence(&mut cursor)?;
            Some((reader, writer, Body::Gap { start, set: NumberSet::read_sequences(&mut cursor)? }))
        }
        _ => None,
    }
}

fn entities(cursor: &mut Cursor<'_>) -> Option<(EntityId, EntityId)> {
    Some((EntityId(cursor.array()?), EntityId(cursor.array()?)))
}

fn entities_and_sequence(cursor: &mut Cursor<'_>) -> Option<(EntityId, EntityId, i64)> {
    let (reader, writer) = entities(cursor)?;
    Some((reader, writer, cursor.sequence()?))
}

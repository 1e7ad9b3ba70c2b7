//! MCAP records: an opcode, the length of the body, and the body, borrowed from the file.

use super::damage::ChunkFault;
use mcap::records::op;
use std::borrow::Cow;

/// The length of a record's header: the opcode and the length of the body.
pub(crate) const HEAD: usize = 9;

/// A record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record<'a> {
    pub(crate) opcode: u8,
    /// The position of the record.
    pub(crate) position: usize,
    /// The length of its body.
    pub(crate) length: usize,
    /// Its body, or only the beginning if no more was requested.
    pub(crate) body: &'a [u8],
}

impl Record<'_> {
    /// The position of the next record.
    pub(crate) fn end(&self) -> usize {
        self.position + HEAD + self.length
    }
}

/// The record at `position`; `None` if the bytes end within it.
pub(crate) fn record_at(bytes: &[u8], position: usize) -> Option<Record<'_>> {
    let mut fields = Fields(bytes.get(position..)?);
    let opcode = fields.u8()?;
    let length = usize::try_from(fields.u64()?).ok()?;
    Some(Record { opcode, position, length, body: fields.bytes(length)? })
}

/// The number of leading bytes of a record's body that a scan needs.
pub(crate) fn wanted(opcode: u8) -> usize {
    match opcode {
        op::MESSAGE => MessageRecord::FIELDS,
        // The chunk's header. No compression has a longer name.
        op::CHUNK => 1 << 10,
        op::SCHEMA | op::CHANNEL | op::MESSAGE_INDEX | op::METADATA => 64 << 20,
        _ => 0,
    }
}

/// A message record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MessageRecord<'a> {
    pub(crate) channel: u16,
    pub(crate) sequence: u32,
    pub(crate) log_time: u64,
    pub(crate) publish_time: u64,
    pub(crate) data: &'a [u8],
}

impl<'a> MessageRecord<'a> {
    /// The number of bytes before the data.
    const FIELDS: usize = 22;

    /// Parses the body of a message record; `None` if it is too short.
    pub(crate) fn parse(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self {
            channel: fields.u16()?,
            sequence: fields.u32()?,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
            data: fields.0,
        })
    }
}

/// Appends a message record.
pub(crate) fn push_message(
    records: &mut Vec<u8>,
    channel: u16,
    sequence: u32,
    log_time: u64,
    publish_time: u64,
    data: &[u8],
) {
    let length = (MessageRecord::FIELDS + data.len()) as u64;
    records.reserve(HEAD + MessageRecord::FIELDS + data.len());
    records.push(op::MESSAGE);
    records.extend_from_slice(&length.to_le_bytes());
    records.extend_from_slice(&channel.to_le_bytes());
    records.extend_from_slice(&sequence.to_le_bytes());
    records.extend_from_slice(&log_time.to_le_bytes());
    records.extend_from_slice(&publish_time.to_le_bytes());
    records.extend_from_slice(data);
}

/// Copies the messages in `records`, and nothing else. `append` appends the data of each to the copy, given its channel
/// and the data that it has; on `false`, the message is left out. Returns the copy, and the number of messages left out.
///
/// # Errors
/// A message record is too short, or the error of `append`.
pub(crate) fn copy_messages(
    records: &[u8],
    mut append: impl FnMut(u16, &[u8], &mut Vec<u8>) -> Result<bool, ChunkFault>,
) -> Result<(Vec<u8>, u64), ChunkFault> {
    let (mut copy, mut left_out) = (Vec::new(), 0);
    let mut position = 0;
    while let Some(record) = record_at(records, position) {
        position = record.end();
        if record.opcode != op::MESSAGE {
            continue;
        }
        let message = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?;
        let begin = copy.len();
        push_message(&mut copy, message.channel, message.sequence, message.log_time, message.publish_time, &[]);
        match append(message.channel, message.data, &mut copy)? {
            true => {
                let length = (copy.len() - begin - HEAD) as u64;
                copy[begin + 1..begin + HEAD].copy_from_slice(&length.to_le_bytes());
            }
            false => {
                copy.truncate(begin);
                left_out += 1;
            }
        }
    }
    Ok((copy, left_out))
}

/// A reader of little-endian fields; each method returns `None` past the end.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    pub(crate) fn bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A string with its length in front. Invalid UTF-8 is replaced.
    pub(crate) fn text(&mut self) -> Option<String> {
        self.str().map(Cow::into_owned)
    }

    /// The same, copied only where it is invalid.
    pub(crate) fn str(&mut self) -> Option<Cow<'a, str>> {
        self.block().map(|bytes| String::from_utf8_lossy(bytes.0))
    }

    /// A nested block of fields with its length in front.
    pub(crate) fn block(&mut self) -> Option<Fields<'a>> {
        let length = usize::try_from(self.u32()?).ok()?;
        self.bytes(length).map(Fields)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truncated_record_is_none() {
        let mut bytes = vec![5, 3, 0, 0, 0, 0, 0, 0, 0, 7, 8, 9];
        assert_eq!(record_at(&bytes, 0).unwrap().body, [7, 8, 9]);
        assert_eq!(record_at(&bytes, 0).unwrap().end(), bytes.len());
        for length in 0..bytes.len() {
            assert!(record_at(&bytes[..length], 0).is_none());
        }
        bytes[1..9].fill(0xff);
        assert!(record_at(&bytes, 0).is_none());
        assert!(record_at(&bytes, usize::MAX).is_none());
    }
}

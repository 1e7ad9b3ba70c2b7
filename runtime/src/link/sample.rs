//! The layout of messages in a sample.

use super::LinkError;
use crate::message::{Message, MessageHeader, Storage};
use iceoryx2::prelude::ZeroCopySend;
use std::rc::Rc;

/// The version of the link protocol. A reader rejects samples of another version.
pub const PROTOCOL_VERSION: u32 = 4;

/// The alignment of each message of a batch, bytes.
const RECORD_ALIGNMENT: usize = 8;

/// The user header of a sample.
///
/// If `count` is 1, the payload is the bytes of `message`. Otherwise `message` is the header of the first message, and
/// the payload contains for each message its header, its bytes, and zeros up to a multiple of 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("gridweave_sample_header_3")]
#[repr(C)]
pub struct SampleHeader {
    /// [`PROTOCOL_VERSION`].
    pub version: u32,
    /// The number of messages.
    pub count: u32,
    /// When it was sent, nanoseconds on the monotonic clock of the machine; 0 in a replay.
    pub sent_at: u64,
    /// The sender that sent it originally: several programs may send on a live link.
    pub origin: u64,
    /// The number of the sample among those of that sender, from 0.
    pub number: u64,
    /// The header of the only or the first message.
    pub message: MessageHeader,
}

impl SampleHeader {
    /// The header of a sample of one message.
    pub(super) fn single(message: MessageHeader) -> Self {
        Self { version: PROTOCOL_VERSION, count: 1, message, ..Default::default() }
    }

    /// Whether the sample has a payload: bytes, or the headers of several messages.
    pub(super) fn has_payload(&self) -> bool {
        self.count > 1 || self.message.length > 0
    }
}

/// Small messages that will be sent in one sample.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    bytes: Vec<u8>,
    first: Option<MessageHeader>,
    count: u32,
}

impl Batch {
    /// Adds a message.
    pub(crate) fn push(&mut self, header: &MessageHeader, bytes: &[u8]) {
        self.first.get_or_insert(*header);
        self.count += 1;
        self.bytes.extend_from_slice(&header.to_bytes());
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(RECORD_ALIGNMENT), 0);
    }

    /// Whether there is nothing to send.
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The payload size of its sample, bytes.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The header and the payload of its sample. The payload of a single message has no message header.
    pub(crate) fn sample(&self) -> (SampleHeader, &[u8]) {
        let message = self.first.unwrap_or_default();
        let header = SampleHeader { count: self.count, ..SampleHeader::single(message) };
        match self.count {
            1 => (header, &self.bytes[MessageHeader::SIZE..MessageHeader::SIZE + message.length as usize]),
            _ => (header, &self.bytes),
        }
    }

    /// Removes all messages; the allocated memory is reused.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.first = None;
        self.count = 0;
    }
}

/// Splits a sample into its messages and passes each to `take`.
pub(crate) fn unpack(
    header: &SampleHeader,
    storage: Rc<dyn Storage>,
    link: &str,
    mut take: impl FnMut(Message),
) -> Result<(), LinkError> {
    let wrong = |problem: String| LinkError::Sample { link: link.to_owned(), problem };
    if header.version != PROTOCOL_VERSION {
        return Err(wrong(format!(
            "it has protocol version {}, and this program has version {PROTOCOL_VERSION}",
            header.version
        )));
    }
    let truncated = || wrong("its messages are longer than the sample".to_owned());
    if header.count == 1 {
        let length = header.message.length as usize;
        take(Message::new(header.message, storage, 0..length).ok_or_else(truncated)?);
        return Ok(());
    }
    let mut start = 0;
    for _ in 0..header.count {
        let body = start + MessageHeader::SIZE;
        let message = storage.bytes().get(start..body).and_then(MessageHeader::from_bytes).ok_or_else(truncated)?;
        let end =
            usize::try_from(message.length).ok().and_then(|length| body.checked_add(length)).ok_or_else(truncated)?;
        take(Message::new(message, Rc::clone(&storage), body..end).ok_or_else(truncated)?);
        start = end.next_multiple_of(RECORD_ALIGNMENT);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{LogTime, MessageFlags};

    /// The messages of a sample: their log times and bytes.
    fn unpacked(header: &SampleHeader, payload: &[u8]) -> Result<Vec<(u64, Vec<u8>)>, LinkError> {
        let mut messages = Vec::new();
        unpack(header, Rc::new(payload.to_vec()), "a.b", |message| {
            messages.push((message.header().log_time.0, message.bytes().to_vec()));
        })?;
        Ok(messages)
    }

    fn batch(messages: &[&[u8]]) -> Batch {
        let mut batch = Batch::default();
        for (time, bytes) in messages.iter().enumerate() {
            let header = MessageHeader {
                log_time: LogTime(time as u64),
                length: bytes.len() as u64,
                flags: MessageFlags::DATA,
                ..Default::default()
            };
            batch.push(&header, bytes);
        }
        batch
    }

    #[test]
    fn unpacking_a_batch_gives_its_messages() {
        for messages in [&[&b"one"[..]][..], &[b"", b"1", b"12345678", b"123456789"]] {
            let batch = batch(messages);
            let (header, payload) = batch.sample();
            let expected: Vec<_> = messages.iter().enumerate().map(|(t, bytes)| (t as u64, bytes.to_vec())).collect();
            assert_eq!(unpacked(&header, payload).unwrap(), expected);
        }
    }

    #[test]
    fn a_truncated_sample_or_wrong_lengths_are_an_error() {
        let batch = batch(&[b"123456789", b"12"]);
        let (header, payload) = batch.sample();
        for end in 0..payload.len() - 8 {
            assert!(unpacked(&header, &payload[..end]).is_err(), "{end}");
        }
        let mut wrong_length = payload.to_vec();
        wrong_length[24..32].fill(0xff);
        assert!(unpacked(&header, &wrong_length).is_err());
    }

    #[test]
    fn a_sample_of_another_version_is_rejected() {
        let batch = batch(&[b"1"]);
        let (header, payload) = batch.sample();
        let error = unpacked(&SampleHeader { version: 1, ..header }, payload).unwrap_err().to_string();
        assert!(error.contains("version 1"), "{error}");
    }
}

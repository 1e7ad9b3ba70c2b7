//! Messages of RTPS, as they are written.

use super::cursor::push_sequence;
use super::guid::{EntityId, Prefix};
use super::number_set::NumberSet;

/// No vendor that is registered.
pub(crate) const VENDOR: [u8; 2] = [0, 0];
/// The version that is spoken.
pub(crate) const VERSION: [u8; 2] = [2, 3];

/// A message that is being written. All numbers are little-endian.
#[derive(Clone, Debug)]
pub(crate) struct Message(Vec<u8>);

impl Message {
    pub(crate) fn new(source: Prefix) -> Self {
        let mut bytes = Vec::with_capacity(256);
        bytes.extend(b"RTPS");
        bytes.extend(VERSION);
        bytes.extend(VENDOR);
        bytes.extend(source.0);
        Self(bytes)
    }

    /// What follows is for one participant alone.
    #[must_use]
    pub(crate) fn to(self, destination: Prefix) -> Self {
        self.part(0x0e, 0, |bytes| bytes.extend(destination.0))
    }

    /// What follows was published at that time, nanoseconds since the Unix epoch.
    #[must_use]
    pub(crate) fn published(self, time: i64) -> Self {
        let (seconds, nanoseconds) = (time.div_euclid(1_000_000_000), time.rem_euclid(1_000_000_000));
        // Rounded up, so that a reader that rounds down gets the written value.
        let fraction = ((nanoseconds << 32) + 999_999_999) / 1_000_000_000;
        self.part(0x09, 0, |bytes| {
            bytes.extend((seconds as u32).to_le_bytes());
            bytes.extend((fraction as u32).to_le_bytes());
        })
    }

    /// A sample, with parameters beside it if there are any.
    #[must_use]
    pub(crate) fn data(
        self,
        reader: EntityId,
        writer: EntityId,
        sequence: i64,
        inline: &[u8],
        is_key: bool,
        payload: &[u8],
    ) -> Self {
        let flags = if inline.is_empty() { 0 } else { 2 } | if is_key { 8 } else { 4 };
        self.part(0x15, flags, |bytes| {
            bytes.extend([0, 0, 16, 0]);
            push_entities(bytes, reader, writer);
            push_sequence(bytes, sequence);
            bytes.extend(inline);
            bytes.extend(payload);
        })
    }

    /// One fragment of a sample, with its number (from 1).
    #[must_use]
    pub(crate) fn fragment(
        self,
        reader: EntityId,
        writer: EntityId,
        sequence: i64,
        number: u32,
        fragment_size: u16,
        sample: &[u8],
    ) -> Self {
        let start = (number as usize).saturating_sub(1).saturating_mul(usize::from(fragment_size)).min(sample.len());
        let end = start.saturating_add(usize::from(fragment_size)).min(sample.len());
        self.part(0x16, 0, |bytes| {
            bytes.extend([0, 0, 28, 0]);
            push_entities(bytes, reader, writer);
            push_sequence(bytes, sequence);
            bytes.extend(number.to_le_bytes());
            bytes.extend(1_u16.to_le_bytes());
            bytes.extend(fragment_size.to_le_bytes());
            bytes.extend((sample.len() as u32).to_le_bytes());
            bytes.extend(&sample[start..end]);
        })
    }

    /// What the writer has, which is to be answered.
    #[must_use]
    pub(crate) fn heartbeat(self, reader: EntityId, writer: EntityId, [first, last]: [i64; 2], count: u32) -> Self {
        self.part(0x07, 0, |bytes| {
            push_entities(bytes, reader, writer);
            push_sequence(bytes, first);
            push_sequence(bytes, last);
            bytes.extend(count.to_le_bytes());
        })
    }

    /// What the reader has, and asks for; `is_final` if no answer is needed where nothing is missing.
    #[must_use]
    pub(crate) fn acknack(
        self,
        reader: EntityId,
        writer: EntityId,
        missing: &NumberSet,
        count: u32,
        is_final: bool,
    ) -> Self {
        self.part(0x06, if is_final { 2 } else { 0 }, |bytes| {
            push_entities(bytes, reader, writer);
            missing.push_sequences(bytes);
            bytes.extend(count.to_le_bytes());
        })
    }

    /// The fragments of a sample that the reader asks for.
    #[must_use]
    pub(crate) fn nack_fragments(
        self,
        reader: EntityId,
        writer: EntityId,
        sequence: i64,
        missing: &NumberSet,
        count: u32,
    ) -> Self {
        self.part(0x12, 0, |bytes| {
            push_entities(bytes, reader, writer);
            push_sequence(bytes, sequence);
            missing.push_fragments(bytes);
            bytes.extend(count.to_le_bytes());
        })
    }

    /// Samples that do not come, of which the set has the later ones.
    #[must_use]
    pub(crate) fn gap(self, reader: EntityId, writer: EntityId, start: i64, set: &NumberSet) -> Self {
        self.part(0x08, 0, |bytes| {
            push_entities(bytes, reader, writer);
            push_sequence(bytes, start);
            set.push_sequences(bytes);
        })
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn part(mut self, kind: u8, flags: u8, write: impl FnOnce(&mut Vec<u8>)) -> Self {
        self.0.extend([kind, flags | 1, 0, 0]);
        let start = self.0.len();
        write(&mut self.0);
        self.0.resize(self.0.len().next_multiple_of(4), 0);
        let length = u16::try_from(self.0.len() - start).unwrap_or_default();
        self.0[start - 2..start].copy_from_slice(&length.to_le_bytes());
        self
    }
}

fn push_entities(bytes: &mut Vec<u8>, reader: EntityId, writer: EntityId) {
    bytes.extend(reader.0);
    bytes.extend(writer.0);
}

#[cfg(test)]
mod tests {
    use super::super::submessage::{Body, submessages};
    use super::*;

    const SOURCE: Prefix = Prefix([7; 12]);
    const OTHER: Prefix = Prefix([9; 12]);
    const READER: EntityId = EntityId::reader(3);
    const WRITER: EntityId = EntityId::writer(300);

    #[test]
    fn what_is_written_is_read_back() {
        let sample: Vec<u8> = (0..100).collect();
        let missing = NumberSet::new(5, [5, 7]);
        let bytes = Message::new(SOURCE)
            .to(OTHER)
            .published(1_700_000_000_123_456_789)
            .data(READER, WRITER, 1, &[], false, &sample)
            .fragment(READER, WRITER, 2, 3, 40, &sample)
            .heartbeat(READER, WRITER, [1, 2], 8)
            .acknack(READER, WRITER, &missing, 9, true)
            .nack_fragments(READER, WRITER, 2, &missing, 10)
            .gap(READER, WRITER, 3, &missing)
            .into_bytes();
        let parts = submessages(&bytes);
        let bodies: Vec<_> = parts.iter().map(|part| part.body.clone()).collect();
        assert_eq!(
            bodies,
            [
                Body::Data { sequence: 1, inline: &[], is_little: true, is_key: false, payload: &sample },
                Body::Fragments {
                    sequence: 2,
                    first: 3,
                    count: 1,
                    fragment_size: 40,
                    sample_size: 100,
                    payload: &sample[80..]
                },
                Body::Heartbeat { first: 1, last: 2, count: 8, is_final: false },
                Body::AckNack { missing: missing.clone(), count: 9, is_final: true },
                Body::NackFragments { sequence: 2, missing: missing.clone(), count: 10 },
                Body::Gap { start: 3, set: missing },
            ]
        );
        for part in parts {
            assert_eq!((part.source, part.destination, part.reader, part.writer), (SOURCE, OTHER, READER, WRITER));
            assert_eq!(part.published, Some(1_700_000_000_123_456_789));
        }
    }

    #[test]
    fn a_message_that_is_cut_off_or_changed_anywhere_does_no_harm() {
        let bytes = Message::new(SOURCE)
            .published(5)
            .data(READER, WRITER, 1, &[0x71, 0, 4, 0, 0, 0, 0, 1, 1, 0, 0, 0], false, &[0, 1, 0, 0])
            .acknack(READER, WRITER, &NumberSet::new(1, [3]), 1, false)
            .into_bytes();
        for at in 0..bytes.len() {
            submessages(&bytes[..at]);
            for value in [0, 1, 0x7f, 0xff] {
                let mut changed = bytes.clone();
                changed[at] = value;
                submessages(&changed);
            }
        }
        assert_eq!(submessages(&bytes).len(), 2);
        assert!(submessages(b"RTPX").is_empty());
    }
}

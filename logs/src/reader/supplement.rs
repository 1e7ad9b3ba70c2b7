//! Supplements of a log: its attachments and metadata records. They pass through a pipeline like messages, on separate
//! channels.

use super::damage::Damage;
use super::record::Fields;
use gridweave_runtime::message::Channel;
use mcap::records::op;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The encoding of their channels: each message is the body of a record, as in the MCAP specification.
const ENCODING: &str = "mcap_record";
/// Name of the metadata record with the outcome of a run.
pub(crate) const OUTCOME_RECORD: &str = "gridweave";

/// The kind of a supplement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SupplementKind {
    /// An attached file.
    Attachment,
    /// Strings by key.
    Metadata,
}

impl SupplementKind {
    /// The kind for a record's opcode.
    pub(crate) fn of_opcode(opcode: u8) -> Option<Self> {
        match opcode {
            op::ATTACHMENT => Some(Self::Attachment),
            op::METADATA => Some(Self::Metadata),
            _ => None,
        }
    }

    /// The channel for supplements of this kind.
    pub(crate) fn channel(self) -> Channel {
        let topic = match self {
            Self::Attachment => "attachments",
            Self::Metadata => "metadata",
        };
        Channel { topic: topic.to_owned(), message_encoding: ENCODING.to_owned(), ..Default::default() }
    }

    /// The kind of a channel's supplements; `None` for a channel of messages.
    pub fn of_channel(channel: &Channel) -> Option<Self> {
        [Self::Attachment, Self::Metadata].into_iter().find(|kind| *channel == kind.channel())
    }
}

/// Whether a metadata record describes the file that it is in, and not its messages: the outcome of its run, and the
/// properties of a rosbag2 file.
pub(crate) fn describes_its_file(name: &str) -> bool {
    [OUTCOME_RECORD, "rosbag2"].contains(&name)
}

/// The name of a metadata record, and its readable entries; `None` without a name.
pub(crate) fn read_metadata(body: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut fields = Fields(body);
    let (name, mut pairs) = (fields.text()?, fields.block()?);
    let mut metadata = BTreeMap::new();
    while let (Some(key), Some(value)) = (pairs.text(), pairs.text()) {
        metadata.insert(key, value);
    }
    Some((name, metadata))
}

/// The damage that a metadata record reports: a run that ended early.
pub(crate) fn damage_of(name: &str, metadata: &BTreeMap<String, String>) -> Option<Damage> {
    let incomplete = name == OUTCOME_RECORD && metadata.get("complete").is_some_and(|complete| complete == "false");
    incomplete.then(|| Damage::Incomplete { reason: metadata.get("reason").cloned().unwrap_or_default() })
}

/// The attachment in the body of a record; `None` if it is truncated or its checksum is wrong.
pub(crate) fn read_attachment(body: &[u8]) -> Option<mcap::Attachment<'_>> {
    let mut fields = Fields(body);
    let (log_time, create_time) = (fields.u64()?, fields.u64()?);
    let (name, media_type) = (fields.text()?, fields.text()?);
    let length = usize::try_from(fields.u64()?).ok()?;
    let data = Cow::Borrowed(fields.bytes(length)?);
    let checksum = fields.u32()?;
    // Zero if the writer did not compute it.
    let is_sound = checksum == 0 || crc32fast::hash(body.get(..body.len() - fields.0.len() - 4)?) == checksum;
    is_sound.then_some(mcap::Attachment { log_time, create_time, name, media_type, data })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &mut Vec<u8>, text: &str) {
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
    }

    fn attachment() -> Vec<u8> {
        let mut body = Vec::from_iter([5_u64, 6].into_iter().flat_map(u64::to_le_bytes));
        text(&mut body, "a.txt");
        text(&mut body, "text/plain");
        body.extend(3_u64.to_le_bytes());
        body.extend(b"abc");
        body.extend(crc32fast::hash(&body).to_le_bytes());
        body
    }

    #[test]
    fn an_attachment_is_read_unless_it_is_damaged() {
        let body = attachment();
        let read = read_attachment(&body).unwrap();
        assert_eq!((read.log_time, read.create_time, &*read.data), (5, 6, b"abc".as_slice()));
        assert_eq!((read.name.as_str(), read.media_type.as_str()), ("a.txt", "text/plain"));
        assert!((0..body.len()).all(|length| read_attachment(&body[..length]).is_none()));
        for place in 0..body.len() {
            let mut damaged = body.clone();
            damaged[place] ^= 1;
            assert!(read_attachment(&damaged).is_none(), "{place}");
        }
        let mut unchecked = body;
        let checksum = unchecked.len() - 4;
        unchecked[checksum..].fill(0);
        assert!(read_attachment(&unchecked).is_some());
    }

    #[test]
    fn a_channel_has_the_kind_of_its_supplements() {
        for kind in [SupplementKind::Attachment, SupplementKind::Metadata] {
            assert_eq!(SupplementKind::of_channel(&kind.channel()), Some(kind));
        }
        assert_eq!(SupplementKind::of_channel(&Channel { topic: "metadata".into(), ..Default::default() }), None);
    }
}

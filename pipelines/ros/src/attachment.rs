//! The attachment of a message: its sequence number, its time, and its publisher.

/// The size of an identifier, bytes.
const GID_SIZE: u8 = 16;
/// The size of an attachment, bytes: two numbers, and the identifier with its length.
const SIZE: usize = 8 + 8 + 1 + GID_SIZE as usize;

/// The attachment of a message, in Zenoh's serialization: numbers are little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// The sequence number of the message from its publisher, from 1.
    pub sequence: i64,
    /// When the message was sent, nanoseconds since the Unix epoch.
    pub source_time: i64,
    /// The publisher's [identifier](super::liveliness::Entity::gid).
    pub gid: [u8; GID_SIZE as usize],
}

impl Attachment {
    /// The attachment as bytes.
    pub fn to_bytes(self) -> [u8; SIZE] {
        let mut bytes = [0; SIZE];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_time.to_le_bytes());
        bytes[16] = GID_SIZE;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    /// The attachment of the bytes of [`to_bytes`](Self::to_bytes); `None` if they are invalid.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; SIZE] = bytes.try_into().ok()?;
        let number = |at: usize| Some(i64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        let gid = bytes.get(17..)?.try_into().ok()?;
        (bytes[16] == GID_SIZE).then_some(())?;
        Some(Self { sequence: number(0)?, source_time: number(8)?, gid })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_is_what_zenohs_serialisation_writes() {
        let attachment = Attachment { sequence: 7, source_time: 1_700_000_000_000_000_001, gid: [9; 16] };
        let (sequence, time) = (attachment.sequence, attachment.source_time);
        let theirs = zenoh_ext::z_serialize(&(sequence, time, attachment.gid.to_vec()));
        assert_eq!(attachment.to_bytes().as_slice(), theirs.to_bytes().as_ref());
        assert_eq!(Attachment::from_bytes(&theirs.to_bytes()), Some(attachment));
    }

    #[test]
    fn invalid_bytes_are_no_attachment() {
        let whole = Attachment { sequence: 1, source_time: 2, gid: [3; 16] }.to_bytes();
        assert_eq!(Attachment::from_bytes(&[]), None);
        assert_eq!(Attachment::from_bytes(&whole[..32]), None);
        assert_eq!(Attachment::from_bytes(&[whole.as_slice(), &[0]].concat()), None);
        let mut other = whole;
        other[16] = 15;
        assert_eq!(Attachment::from_bytes(&other), None);
    }
}

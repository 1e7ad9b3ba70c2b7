//! Identifiers of participants and their endpoints (RTPS 2.3, 8.2.4 and 9.3.1).

use std::fmt;

/// The identifier of a participant, the first part of those of its endpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Prefix(pub(crate) [u8; 12]);

impl Prefix {
    /// Whether it is of a participant of this vendor (RTPS 2.3, 9.3.1.5).
    pub(crate) fn is_of(self, vendor: [u8; 2]) -> bool {
        self.0.starts_with(&vendor)
    }

    /// Stands for all participants.
    pub(crate) const UNKNOWN: Self = Self([0; 12]);
}

impl fmt::Display for Prefix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The identifier of an endpoint within its participant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EntityId(pub(crate) [u8; 4]);

impl EntityId {
    /// Stands for all endpoints that match.
    pub(crate) const UNKNOWN: Self = Self([0; 4]);
    pub(crate) const PARTICIPANT: Self = Self([0, 0, 1, 0xc1]);
    pub(crate) const PARTICIPANTS_WRITER: Self = Self([0, 1, 0, 0xc2]);
    pub(crate) const PARTICIPANTS_READER: Self = Self([0, 1, 0, 0xc7]);
    pub(crate) const PUBLICATIONS_WRITER: Self = Self([0, 0, 3, 0xc2]);
    pub(crate) const PUBLICATIONS_READER: Self = Self([0, 0, 3, 0xc7]);
    pub(crate) const SUBSCRIPTIONS_WRITER: Self = Self([0, 0, 4, 0xc2]);
    pub(crate) const SUBSCRIPTIONS_READER: Self = Self([0, 0, 4, 0xc7]);

    /// By these participants say that they are alive. Nothing is written here, as they say so by their announcements, too.
    pub(crate) const MESSAGES_WRITER: Self = Self([0, 2, 0, 0xc2]);
    pub(crate) const MESSAGES_READER: Self = Self([0, 2, 0, 0xc7]);

    /// The writer of a topic without keys, as all topics of ROS are.
    pub(crate) const fn writer(number: u16) -> Self {
        let [high, low] = number.to_be_bytes();
        Self([0, high, low, 0x03])
    }

    /// The reader of a topic without keys.
    pub(crate) const fn reader(number: u16) -> Self {
        let [high, low] = number.to_be_bytes();
        Self([0, high, low, 0x04])
    }

    /// Whether it is a writer, and no reader.
    pub(crate) const fn is_writer(self) -> bool {
        matches!(self.0[3] & 0x3f, 0x02 | 0x03)
    }
}

/// The identifier of an endpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Guid {
    pub(crate) prefix: Prefix,
    pub(crate) entity: EntityId,
}

impl Guid {
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let prefix = Prefix(bytes.get(..12)?.try_into().ok()?);
        Some(Self { prefix, entity: EntityId(bytes.get(12..16)?.try_into().ok()?) })
    }

    pub(crate) fn to_bytes(self) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..12].copy_from_slice(&self.prefix.0);
        bytes[12..].copy_from_slice(&self.entity.0);
        bytes
    }
}

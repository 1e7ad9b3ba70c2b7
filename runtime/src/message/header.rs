//! The header of every message, with the same layout in shared memory and in the code.

use super::{FixedText, LogTime};
use iceoryx2::prelude::ZeroCopySend;

/// The maximum length of a robot's name, bytes.
pub const LONGEST_ROBOT_NAME: usize = 64;

/// The maximum length of a topic, bytes.
pub const LONGEST_TOPIC: usize = 128;

/// The kind of a message, as bit flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct MessageFlags(pub u32);

impl MessageFlags {
    /// The bytes are a ROS 2 message.
    pub const DATA: Self = Self(1);
    /// No message before `log_time` will follow on this link. There is no payload.
    pub const WATERMARK: Self = Self(2);
    /// The stream ends here. There is no payload.
    pub const END: Self = Self(4);
    /// The bytes are a [`Channel`](super::Channel): the next messages with the same `channel` were logged there.
    pub const CHANNEL: Self = Self(8);
    /// The message is sent again for late joiners.
    pub const REPEATED: Self = Self(16);

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// The header of a message.
///
/// Its layout in shared memory is `#[repr(C)]`, little-endian, 240 bytes. It is part of version 4 of the link protocol.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct MessageHeader {
    /// The sequence number of the message on its link, from 0.
    pub sequence: u64,
    /// When the message was logged. An output of a stage has the log time of the input that caused it.
    pub log_time: LogTime,
    /// When the message was published, nanoseconds, as in the input log.
    pub publish_time: u64,
    /// The number of payload bytes that belong to the message.
    pub length: u64,
    /// The kind of the message.
    pub flags: MessageFlags,
    /// The number of the channel that it was logged on, as announced on the same link; 0 for the output of a stage.
    pub channel: u32,
    /// Its sequence number in the input log.
    pub log_sequence: u32,
    /// Zero.
    pub reserved: u32,
    /// The robot it is about; empty if none in particular.
    pub robot: FixedText<LONGEST_ROBOT_NAME>,
    /// Its topic in a log.
    pub topic: FixedText<LONGEST_TOPIC>,
}

impl MessageHeader {
    /// The size in memory, bytes.
    pub const SIZE: usize = 240;

    /// The header as in memory.
    pub fn to_bytes(&self) -> [u8; Self::SIZE] {
        let mut bytes = [0; Self::SIZE];
        let words = [self.sequence, self.log_time.0, self.publish_time, self.length];
        for (target, word) in bytes[..32].chunks_exact_mut(8).zip(words) {
            target.copy_from_slice(&word.to_le_bytes());
        }
        let halves = [self.flags.0, self.channel, self.log_sequence, self.reserved];
        for (target, half) in bytes[32..48].chunks_exact_mut(4).zip(halves) {
            target.copy_from_slice(&half.to_le_bytes());
        }
        bytes[48..112].copy_from_slice(self.robot.as_bytes());
        bytes[112..].copy_from_slice(self.topic.as_bytes());
        bytes
    }

    /// The header of the bytes of [`to_bytes`](Self::to_bytes). `None` unless there are [`SIZE`](Self::SIZE) bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::SIZE] = bytes.try_into().ok()?;
        let word = |at: usize| Some(u64::from_le_bytes(bytes[at..at + 8].try_into().ok()?));
        let half = |at: usize| Some(u32::from_le_bytes(bytes[at..at + 4].try_into().ok()?));
        Some(Self {
            sequence: word(0)?,
            log_time: LogTime(word(8)?),
            publish_time: word(16)?,
            length: word(24)?,
            flags: MessageFlags(half(32)?),
            channel: half(36)?,
            log_sequence: half(40)?,
            reserved: half(44)?,
            robot: FixedText::from_bytes(bytes[48..112].try_into().ok()?),
            topic: FixedText::from_bytes(bytes[112..].try_into().ok()?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_the_protocol() {
        assert_eq!(std::mem::size_of::<MessageHeader>(), MessageHeader::SIZE);
        assert_eq!(std::mem::offset_of!(MessageHeader, flags), 32);
        assert_eq!(std::mem::offset_of!(MessageHeader, robot), 48);
        assert_eq!(std::mem::offset_of!(MessageHeader, topic), 112);
    }

    #[test]
    fn reading_a_written_header_gives_the_same_header() {
        let header = MessageHeader {
            sequence: 1,
            log_time: LogTime(2),
            publish_time: 3,
            length: 4,
            flags: MessageFlags::DATA,
            channel: 5,
            log_sequence: 6,
            reserved: 0,
            robot: FixedText::new("robot1").unwrap(),
            topic: FixedText::new("/robot1/map").unwrap(),
        };
        assert_eq!(MessageHeader::from_bytes(&header.to_bytes()), Some(header));
        assert_eq!(MessageHeader::from_bytes(&[0; 207]), None);
    }
}

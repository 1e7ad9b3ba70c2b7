//! The header that goes with every message, the same in shared memory as in the code.

use super::{FixedText, LogTime};
use iceoryx2::prelude::ZeroCopySend;

/// What a message is, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct MessageFlags(pub u32);

impl MessageFlags {
    /// The bytes are a ROS 2 message.
    pub const DATA: Self = Self(1);
    /// Nothing before `log_time` will follow on this link. There are no bytes.
    pub const WATERMARK: Self = Self(2);
    /// The stream ends here. There are no bytes.
    pub const END: Self = Self(4);
    /// The bytes are a [`Channel`](super::Channel): the next messages with the same `channel` were logged there.
    pub const CHANNEL: Self = Self(8);
    /// The run has failed. The bytes are the reason, in UTF-8.
    pub const ABORT: Self = Self(16);

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// What goes with every message.
///
/// In shared memory it is laid out as `#[repr(C)]`, little-endian, 208 bytes; it is part of version 1 of the link
/// protocol.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct MessageHeader {
    /// Counts the messages of one link, from 0.
    pub sequence: u64,
    /// When the message was logged. A stage's output carries the time of the input that caused it.
    pub log_time: LogTime,
    /// When the message was published, in nanoseconds; kept from the log.
    pub publish_time: u64,
    /// The number of payload bytes that belong to the message.
    pub length: u64,
    /// What it is.
    pub flags: MessageFlags,
    /// The channel it was logged on, as announced on the same link; 0 for what a stage has made.
    pub channel: u32,
    /// Its sequence number in the log it came from.
    pub log_sequence: u32,
    /// Zero.
    pub reserved: u32,
    /// The robot it is about; empty if none in particular.
    pub robot: FixedText<32>,
    /// The topic that it has, or will have, in a log.
    pub topic: FixedText<128>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_that_of_the_protocol() {
        assert_eq!(std::mem::size_of::<MessageHeader>(), 208);
        assert_eq!(std::mem::offset_of!(MessageHeader, flags), 32);
        assert_eq!(std::mem::offset_of!(MessageHeader, robot), 48);
        assert_eq!(std::mem::offset_of!(MessageHeader, topic), 80);
    }
}

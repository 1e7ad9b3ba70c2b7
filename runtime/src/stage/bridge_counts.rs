//! The names of counts of the stages of a bridge between machines, from which a command decides its exit status.

/// Messages that the other end had not acknowledged when the sender ended.
pub const UNACKNOWLEDGED: &str = "messages that were not acknowledged before the end";
/// Messages that a sender dropped because its queue was full.
pub const DROPPED: &str = "messages dropped because the bridge does not keep up";
/// Messages replaced by a later one of their topic before they were sent.
pub const SUPERSEDED: &str = "messages superseded by the last of their topic";
/// The bytes that a sender has sent, compressed.
pub const BYTES_SENT: &str = "bytes sent";
/// Messages of a link that were overwritten before they were read.
pub const MISSED: &str = "messages missed";

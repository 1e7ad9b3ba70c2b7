//! Messages: a header, and the bytes of a ROS 2 message in CDR, possibly in shared memory.

mod blank;
mod channel;
mod header;
mod text;
mod time;

pub(crate) use blank::write_all;
pub use blank::{Blank, Filled, Write, write_vec};
pub use channel::Channel;
pub use header::{LONGEST_ROBOT_NAME, LONGEST_TOPIC, MessageFlags, MessageHeader};
pub use text::{FixedText, TextTooLong, shortened};
pub use time::LogTime;

use std::fmt;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;

/// Memory with the bytes of one or more messages: a sample in shared memory, or a buffer on the heap.
pub trait Storage {
    /// All bytes of this memory.
    fn bytes(&self) -> &[u8];
}

impl Storage for Vec<u8> {
    fn bytes(&self) -> &[u8] {
        self
    }
}

/// A buffer that readers in several threads share.
impl Storage for Arc<Vec<u8>> {
    fn bytes(&self) -> &[u8] {
        self
    }
}

/// A message, borrowed from the memory that it was received in.
///
/// Cloning it copies the header, but no payload. The memory is released to its sender when the last clone is dropped,
/// so a stage may keep a map for as long as it needs it.
#[derive(Clone)]
pub struct Message {
    header: MessageHeader,
    storage: Rc<dyn Storage>,
    range: Range<usize>,
    wire: usize,
}

impl Message {
    /// A message whose bytes are the given range of `storage`. `None` if the range is out of bounds.
    pub fn new(header: MessageHeader, storage: Rc<dyn Storage>, range: Range<usize>) -> Option<Self> {
        storage.bytes().get(range.clone())?;
        Some(Self { header, storage, range, wire: 0 })
    }

    /// A message that owns its bytes.
    pub fn from_vec(header: MessageHeader, bytes: Vec<u8>) -> Self {
        let range = 0..bytes.len();
        Self { header, storage: Rc::new(bytes), range, wire: 0 }
    }

    /// The header.
    pub fn header(&self) -> &MessageHeader {
        &self.header
    }

    /// The encoded message: ROS 2 CDR with its four bytes of encapsulation.
    pub fn bytes(&self) -> &[u8] {
        // The range was checked when the message was made.
        &self.storage.bytes()[self.range.clone()]
    }

    /// The robot that the message is about; empty if it is about none in particular.
    pub fn robot(&self) -> &str {
        self.header.robot.as_str()
    }

    /// The wire that it was received on, an index among all wires of the reading stage.
    pub fn wire(&self) -> usize {
        self.wire
    }

    /// The same message with another wire.
    #[must_use]
    pub fn on_wire(mut self, wire: usize) -> Self {
        self.wire = wire;
        self
    }

    /// Decodes the message as the ROS 2 type `T`, which may borrow from it.
    pub fn decode<'a, T: serde::Deserialize<'a>>(&'a self) -> Result<T, crate::ros::DecodeError> {
        crate::ros::decode(self.bytes())
    }
}

impl fmt::Debug for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Message").field("header", &self.header).field("length", &self.range.len()).finish()
    }
}

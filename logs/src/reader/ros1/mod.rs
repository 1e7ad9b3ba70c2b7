//! ROS 1: bags (format 2.0), and its messages in MCAP files.
//!
//! A bag is a sequence of records, each with a header of named fields and data: connections, with the topic, type and
//! definition of messages; chunks of messages, each followed by an index; and, if the bag was closed, all connections
//! again. The messages are returned as in ROS 2: with ROS 2 type names in their definitions, and encoded in CDR; and so
//! are ROS 1 messages in MCAP files, which `mcap convert` makes of bags.
//!
//! This is not a library, because the messages must be converted to CDR without a ROS installation, and because
//! truncated and unindexed bags must be readable.

mod bag;
mod definition;
mod messages;
mod record;

#[cfg(test)]
mod tests;

pub(crate) use bag::{Bag, BagChunk};
pub(crate) use messages::{Converted, convert_messages};
pub(crate) use record::{BAG, CHUNK, CHUNK_INFO, CONNECTION, INDEX, MESSAGE};

/// The magic bytes of a bag.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// The encoding of messages (MCAP registry).
pub(crate) const MESSAGES: &str = "ros1";
/// The encoding of their definitions (MCAP registry).
pub(crate) const DEFINITION: &str = "ros1msg";
/// The entry of a channel's metadata that says whether late subscribers get the last message: `1` in bags, `true` in the
/// profile `ros1` of MCAP.
pub(crate) const LATCHING: &str = "latching";

//! ROS 1 bags (format 2.0).
//!
//! A bag is a sequence of records, each with a header of named fields and data: connections, with the topic, type and
//! definition of messages; chunks of messages, each followed by an index; and, if the bag was closed, all connections
//! again. The messages are returned as in ROS 2: with ROS 2 type names in their definitions, and encoded in CDR.
//!
//! This is not a library, because the messages must be converted to CDR without a ROS installation, and because
//! truncated and unindexed bags must be readable.

mod bag;
mod definition;
mod record;

#[cfg(test)]
mod tests;

pub(crate) use bag::{Bag, BagChunk};
pub(crate) use record::{BAG, CHUNK, CHUNK_INFO, CONNECTION, INDEX, MESSAGE};

/// The magic bytes of a bag.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

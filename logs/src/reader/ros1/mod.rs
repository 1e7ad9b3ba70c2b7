//! Bags of ROS 1 (format 2.0).
//!
//! A bag is a sequence of records, each a header of named fields and data: connections, which say the topic, type and definition
//! of messages; chunks of messages, with an index behind each; and, if the bag was closed, all connections again. The messages
//! are given out as those of ROS 2: their definitions by the names that types have there, and their bytes in CDR.

mod bag;
mod definition;
mod record;

#[cfg(test)]
mod tests;

pub(crate) use bag::{Bag, BagChunk};

/// What a bag begins with.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

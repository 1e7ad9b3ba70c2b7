//! The rosbag2 databases (`.db3`) that ROS 2 wrote by default up to Humble.
//!
//! The table `topics` has a row per topic, the table `messages` a row per message, and since Iron `message_definitions`
//! the definitions of the types. A database is opened as immutable, so that no file is created beside it. It is scanned
//! once by row id to find the blocks, and each block is read on demand. If rows cannot be read, reading continues with
//! the next readable row.

mod database;
mod rows;
mod tables;
mod torn;

#[cfg(test)]
mod tests;

pub(crate) use database::{Database, write_ahead_log};
pub(crate) use rows::Rows;

/// The magic bytes of a database.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";

//! Databases of rosbag2 (`.db3`), the bags that ROS 2 wrote up to Humble unless told otherwise.
//!
//! The table `topics` has a row for each topic, the table `messages` a row for each message, and from Iron on
//! `message_definitions` the definitions of the types. A database is opened as one that nobody writes, so that nothing is left
//! beside it; it is walked over once by the numbers of its rows, which gives the blocks, and each block is read when its turn
//! comes. Where rows cannot be read, those behind them are looked for.

mod database;
mod rows;
mod tables;
mod torn;

#[cfg(test)]
mod tests;

pub(crate) use database::Database;
pub(crate) use rows::Rows;

/// What a database begins with.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";

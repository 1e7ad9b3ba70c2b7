//! The supported containers of messages.

use super::bytes::FileBytes;
use super::ros1::Bag;
use super::sqlite::Database;

/// An open log file.
#[derive(Debug)]
pub(crate) enum Storage {
    /// An MCAP file.
    Mcap(FileBytes),
    /// A rosbag2 database.
    Sqlite(Database),
    /// A ROS 1 bag.
    Ros1(Bag),
}

impl Storage {
    /// The name of the container.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Mcap(_) => "MCAP",
            Self::Sqlite(_) => "SQLite",
            Self::Ros1(_) => "ROS 1 bag",
        }
    }

    /// Whether another program has truncated the file since.
    pub(crate) fn is_cut(&self) -> bool {
        match self {
            Self::Mcap(file) => file.is_cut(),
            Self::Sqlite(database) => database.is_cut(),
            Self::Ros1(bag) => bag.file.is_cut(),
        }
    }
}

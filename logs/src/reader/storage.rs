//! The containers that messages are in.

use super::bytes::FileBytes;
use super::ros1::Bag;
use super::sqlite::Database;

/// A file that messages are read from.
#[derive(Debug)]
pub(crate) enum Storage {
    /// An MCAP file.
    Mcap(FileBytes),
    /// A database of rosbag2.
    Sqlite(Database),
    /// A bag of ROS 1.
    Ros1(Bag),
}

impl Storage {
    /// What the container is called.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Mcap(_) => "MCAP",
            Self::Sqlite(_) => "SQLite",
            Self::Ros1(_) => "ROS 1 bag",
        }
    }

    /// Whether another program has cut the file since.
    pub(crate) fn is_cut(&self) -> bool {
        match self {
            Self::Mcap(file) => file.is_cut(),
            Self::Sqlite(database) => database.is_cut(),
            Self::Ros1(bag) => bag.file.is_cut(),
        }
    }
}

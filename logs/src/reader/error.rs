//! The error when a log cannot be read at all.

use std::path::PathBuf;

/// A log cannot be read. Damage that leaves a part readable is a [`Damage`](super::Damage) instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// No input was given.
    #[error("no input log: give a file (MCAP, SQLite of rosbag2, ROS 1 bag), or the folder of a ROS 2 bag")]
    NothingGiven,
    /// The path does not exist.
    #[error("{}: no such file or folder", .path.display())]
    Missing {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The user has no permission to read the path.
    #[error("{}: permission denied; check it with `ls -l`", .path.display())]
    NoPermission {
        /// The path as it was given.
        path: PathBuf,
    },
    /// Another error of the operating system.
    #[error("{}: {}", .path.display(), crate::os_error::of_reading(.cause))]
    Io {
        /// The path.
        path: PathBuf,
        /// The error of the operating system.
        cause: std::io::Error,
    },
    /// The file is empty.
    #[error("{}: the file is empty; its recorder may have been stopped before it wrote anything", .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file is of another type.
    #[error("{}: not a readable log (MCAP, SQLite of rosbag2, ROS 1 bag); it looks like {looks_like}; {fix}", .path.display())]
    NotALog {
        /// The file.
        path: PathBuf,
        /// The type by its first bytes, such as "a ROS 1 bag".
        looks_like: &'static str,
        /// How to make it readable.
        fix: &'static str,
    },
    /// A compressed file cannot be decompressed.
    #[error("{}: cannot decompress it: {cause}", .path.display())]
    Decompress {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        cause: std::io::Error,
    },
    /// A map file cannot be read.
    #[error("{cause}")]
    Map {
        /// The file.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A database is not a rosbag2 bag, or too damaged.
    #[error("{}: cannot read the database: {cause}", .path.display())]
    Database {
        /// The file.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A database has its messages only in a journal that its recorder did not merge.
    #[error("{}: the recorder did not close the database, and its messages are in {}; `sqlite3 FILE 'pragma wal_checkpoint'` on a copy of both merges them", .path.display(), .journal.display())]
    OnlyJournal {
        /// The file.
        path: PathBuf,
        /// The journal.
        journal: PathBuf,
    },
    /// The file starts like a log, and is truncated or damaged before its first whole message.
    #[error("{}: damaged before the first whole message ({damage}); use another copy", .path.display())]
    NothingLeft {
        /// The file.
        path: PathBuf,
        /// The first damage that was found.
        damage: super::Damage,
    },
    /// The file has no message of a channel that can be kept.
    #[error("{}: it has no message that can be read: the descriptions of its channels are larger than the 64 MiB that are kept, and {count} were left out", .path.display())]
    ManyDefinitions {
        /// The file.
        path: PathBuf,
        /// The number of channels that were left out.
        count: usize,
    },
    /// A folder is not a bag.
    #[error("{}: the folder has neither a metadata.yaml with content nor an .mcap or .db3 file; {advice}", .path.display())]
    NotABag {
        /// The folder.
        path: PathBuf,
        /// What to give instead.
        advice: String,
    },
    /// The metadata of a ROS 2 bag cannot be parsed.
    #[error("{}: not the metadata of a ROS 2 bag ({cause}); give its .mcap or .db3 files instead", .path.display())]
    BagDescription {
        /// The `metadata.yaml`.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
    /// A file is given twice, which would duplicate its messages.
    #[error("{}: the log is given twice; give it once", .path.display())]
    Duplicate {
        /// The file.
        path: PathBuf,
    },
}

impl ReadError {
    /// Classifies an error of the operating system.
    pub(crate) fn io(path: impl Into<PathBuf>, cause: std::io::Error) -> Self {
        let path = path.into();
        match cause.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { path },
            std::io::ErrorKind::PermissionDenied => Self::NoPermission { path },
            _ => Self::Io { path, cause },
        }
    }
}

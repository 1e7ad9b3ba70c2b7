//! Why a log cannot be read at all.

use std::path::PathBuf;

/// A log cannot be read. Damage that leaves some of it readable is a [`Damage`](super::Damage) instead.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// No file was named.
    #[error("no log is given: name a file (MCAP, SQLite of rosbag2, ROS 1 bag), or the folder of a ROS 2 bag")]
    NothingGiven,
    /// The path does not exist.
    #[error("{}: there is no such file or folder", .path.display())]
    Missing {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The user may not read the path.
    #[error("{}: permission denied; check who may read it, for example with `ls -l`", .path.display())]
    NoPermission {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The operating system refuses for another reason.
    #[error("{}: {cause}", .path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// The file has no bytes.
    #[error("{}: the file is empty; its recorder may have been stopped before it wrote anything", .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file is something else.
    #[error("{}: it is no log that can be read (MCAP, SQLite of rosbag2, ROS 1 bag) but looks like {looks_like}; {cure}", .path.display())]
    NotALog {
        /// The file.
        path: PathBuf,
        /// What its first bytes say, such as "a ROS 1 bag".
        looks_like: &'static str,
        /// What would mend it.
        cure: &'static str,
    },
    /// A file that is packed cannot be unpacked.
    #[error("{}: it cannot be unpacked: {cause}; there must be room for all of it where temporary files are, which TMPDIR names", .path.display())]
    Unpack {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// A map file cannot be read.
    #[error("{cause}")]
    Map {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// A database is none of rosbag2, or too damaged.
    #[error("{}: the database cannot be read: {cause}", .path.display())]
    Database {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// The file begins as a log does and breaks off, or is damaged, before its first whole message.
    #[error("{}: it is damaged, and no whole message is left in it ({damage}); take another copy", .path.display())]
    NothingLeft {
        /// The file.
        path: PathBuf,
        /// What was found first.
        damage: super::Damage,
    },
    /// A folder is no bag.
    #[error("{}: the folder holds neither metadata.yaml nor an .mcap or .db3 file; name the log itself", .path.display())]
    NotABag {
        /// The folder.
        path: PathBuf,
    },
    /// The description of a ROS 2 bag cannot be understood.
    #[error("{}: it does not describe a ROS 2 bag ({cause}); name its .mcap or .db3 files instead", .path.display())]
    BagDescription {
        /// The `metadata.yaml`.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// A file is named twice, which would double its messages.
    #[error("{}: the log is given twice; name it once", .path.display())]
    Duplicate {
        /// The file.
        path: PathBuf,
    },
}

impl ReadError {
    /// Names what the operating system refused.
    pub(crate) fn io(path: impl Into<PathBuf>, cause: std::io::Error) -> Self {
        let path = path.into();
        match cause.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { path },
            std::io::ErrorKind::PermissionDenied => Self::NoPermission { path },
            _ => Self::Io { path, cause },
        }
    }
}

//! The error when a log cannot be written.

use crate::file::{WriteError, folder_of};
use mcap::McapError;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The error when a log cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum LogWriteError {
    /// The path is a folder.
    #[error("{0} is a folder; name a file in it")]
    IsFolder(PathBuf),
    /// The folder of the file does not exist.
    #[error("there is no folder {0}; create it, or name a file elsewhere")]
    NoFolder(PathBuf),
    /// The user has no permission to write there.
    #[error("permission denied to write {0}; change its permissions, or name a file elsewhere")]
    Denied(PathBuf),
    /// Another program writes the file, or it is not a regular file.
    #[error(transparent)]
    Output(WriteError),
    /// The disk is full.
    #[error("there is no room left for {0}; free space on its disk, or name a file elsewhere")]
    NoRoom(PathBuf),
    /// The file would be larger than a limit.
    #[error(
        "{0} would be larger than the file system or `ulimit -f` allows; raise the limit, or name a file elsewhere"
    )]
    TooLarge(PathBuf),
    /// Another error of the file system.
    #[error("{path}: {source}")]
    Io {
        /// The log.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The format does not allow it, for instance more than 65,535 channels.
    #[error("{path}: {message}")]
    Format {
        /// The log.
        path: PathBuf,
        /// The limit.
        message: String,
    },
}

impl From<WriteError> for LogWriteError {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Io { path, error } => Self::from_io(&path, error),
            other => Self::Output(other),
        }
    }
}

impl LogWriteError {
    pub(super) fn from_io(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::IsADirectory => Self::IsFolder(path),
            // In folders such as /proc nothing can be made, and the system calls that not found, too.
            ErrorKind::NotFound | ErrorKind::NotADirectory if !folder_of(&path).is_dir() => {
                Self::NoFolder(folder_of(&path).to_owned())
            }
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => Self::Denied(path),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::NoRoom(path),
            ErrorKind::FileTooLarge => Self::TooLarge(path),
            _ => Self::Io { path, source },
        }
    }

    pub(super) fn from_mcap(path: &Path, error: McapError) -> Self {
        match error {
            McapError::Io(source) => Self::from_io(path, source),
            other => Self::Format { path: path.to_owned(), message: other.to_string() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_is_there_is_not_missing() {
        let text = |path: &str| LogWriteError::from_io(Path::new(path), ErrorKind::NotFound.into()).to_string();
        assert!(text("/proc/out.mcap").contains("/proc/out.mcap: "), "{}", text("/proc/out.mcap"));
        assert!(text("/no/folder/out.mcap").contains("there is no folder /no/folder"));
    }

    #[test]
    fn a_limit_of_the_size_is_no_full_disk() {
        let text = |kind: ErrorKind| LogWriteError::from_io(Path::new("a.mcap"), kind.into()).to_string();
        assert!(text(ErrorKind::FileTooLarge).contains("`ulimit -f`"));
        assert!(text(ErrorKind::StorageFull).contains("free space"));
    }
}

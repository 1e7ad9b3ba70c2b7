//! Why a log cannot be written.

use crate::file::{WriteError, folder_of};
use mcap::McapError;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Why a log cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum LogWriteError {
    /// The name is that of a folder.
    #[error("{0} is a folder; name a file in it")]
    IsFolder(PathBuf),
    /// The folder that the file would lie in does not exist.
    #[error("there is no folder {0}; make it, or name a file elsewhere")]
    NoFolder(PathBuf),
    /// The user has no right to write there.
    #[error("{0} may not be written; change its permissions, or name a file elsewhere")]
    Denied(PathBuf),
    /// Another program writes it, or it is no regular file.
    #[error(transparent)]
    Output(WriteError),
    /// There is no room.
    #[error("there is no room left for {0}; make room on its disk, or name a file elsewhere")]
    NoRoom(PathBuf),
    /// The file system fails otherwise.
    #[error("{path}: {source}")]
    Io {
        /// The log.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The format does not allow it, for instance more than 65,535 channels.
    #[error("{path}: {message}")]
    Format {
        /// The log.
        path: PathBuf,
        /// What it does not allow.
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
            ErrorKind::NotFound | ErrorKind::NotADirectory => Self::NoFolder(folder_of(&path).to_owned()),
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => Self::Denied(path),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => Self::NoRoom(path),
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

//! The error when a map file cannot be read or written.

use crate::file::WriteError;
use std::path::PathBuf;

/// The error when a map file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// A file cannot be read.
    #[error("cannot read the map file {path}: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: std::io::Error,
    },
    /// The YAML file does not describe a map.
    #[error("{path} does not describe a map: {message}")]
    Yaml {
        /// The file.
        path: PathBuf,
        /// The cause, and its position.
        message: String,
    },
    /// A value of the YAML file is invalid.
    #[error("{path}: `{field}` {problem}")]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: &'static str,
        /// The cause, and valid values.
        problem: String,
    },
    /// The image is missing, truncated or in an unsupported format.
    #[error("cannot read {path}, the image of the map {yaml}: {message}")]
    Image {
        /// The image.
        path: PathBuf,
        /// The file that names it.
        yaml: PathBuf,
        /// The cause.
        message: String,
    },
    /// The map to save is invalid.
    #[error("cannot save a map to {path}: {problem}")]
    Map {
        /// The file to write.
        path: PathBuf,
        /// The problem with the map or the name.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

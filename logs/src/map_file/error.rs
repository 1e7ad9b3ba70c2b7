//! Why a map file cannot be read or written.

use crate::file::WriteError;
use std::path::PathBuf;

/// Why a map file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// A file cannot be read.
    #[error("cannot read the map file {path}: {source}")]
    Read {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The YAML file is no description of a map.
    #[error("{path} does not describe a map: {message}")]
    Yaml {
        /// Which.
        path: PathBuf,
        /// What is wrong, and where.
        message: String,
    },
    /// A value of the YAML file makes no sense.
    #[error("{path}: `{field}` {problem}")]
    Field {
        /// Which file.
        path: PathBuf,
        /// Which field.
        field: &'static str,
        /// What is wrong, and what would be right.
        problem: String,
    },
    /// The image is missing, cut or of a format that is not supported.
    #[error("cannot read {path}, the image of the map {yaml}: {message}")]
    Image {
        /// The image.
        path: PathBuf,
        /// The file that names it.
        yaml: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The map to be saved is none.
    #[error("cannot save a map to {path}: {problem}")]
    Map {
        /// Where to.
        path: PathBuf,
        /// What is wrong with the map or the name.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

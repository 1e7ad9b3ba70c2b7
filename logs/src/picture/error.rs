//! Why a picture cannot be made.

use std::path::PathBuf;

/// Why a picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// A map is none.
    #[error("map {index} of the picture {problem}")]
    Map {
        /// Its place in the list, from 0.
        index: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// There is nothing to show.
    #[error("there is nothing to show: no cell of any map is known")]
    Empty,
    /// The picture cannot be encoded.
    #[error("the picture cannot be encoded as PNG: {0}")]
    Png(String),
    /// The file cannot be written.
    #[error("cannot write the picture {path}: {source}; see that its folder exists, may be written and has room")]
    Write {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

//! Why a picture cannot be made.

use crate::file::WriteError;

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
    #[error(transparent)]
    Write(#[from] WriteError),
}

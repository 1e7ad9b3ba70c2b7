//! The error when a picture cannot be made.

use crate::drawing::DrawingError;
use crate::file::WriteError;
use std::path::PathBuf;

/// The error when a picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// A map is invalid.
    #[error("map {index} of the picture {problem}")]
    Map {
        /// Its index in the list, from 0.
        index: usize,
        /// The problem.
        problem: &'static str,
    },
    /// There is nothing to show.
    #[error("there is nothing to show: no cell of any map is known")]
    Empty,
    /// There would be too many grid lines.
    #[error(
        "a line every {metres} m cannot be drawn: it must be above 0 m, and wide enough for the picture to have 400 lines at most"
    )]
    Grid {
        /// The distance between lines.
        metres: f64,
    },
    /// The format of the picture's file name is not supported.
    #[error("{} has an unsupported extension; use .png, .svg or .pdf", .0.display())]
    Format(PathBuf),
    /// The picture cannot be encoded.
    #[error(transparent)]
    Drawing(#[from] DrawingError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

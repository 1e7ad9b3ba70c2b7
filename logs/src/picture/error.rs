//! Why a picture cannot be made.

use crate::drawing::DrawingError;
use crate::file::WriteError;
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
    /// There would be more lines than can be told apart.
    #[error(
        "a line every {metres} m cannot be drawn: it must be above 0 m, and wide enough for the picture to have 400 lines at most"
    )]
    Grid {
        /// From line to line.
        metres: f64,
    },
    /// No such format is written.
    #[error("{} ends on none of .png, .svg and .pdf, which say what is written", .0.display())]
    Format(PathBuf),
    /// The picture cannot be encoded.
    #[error(transparent)]
    Drawing(#[from] DrawingError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

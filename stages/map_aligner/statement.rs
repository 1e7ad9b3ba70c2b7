//! What is told of a pair of robots.

use super::{MapAlignment, MapAlignments};

/// What is to be told of a pair of robots.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// The robot whose map stays, the first of the two by name.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// Guesses, the best first, each with what speaks for it; or why there are none.
    pub found: Result<Vec<(MapAlignment, String)>, String>,
    /// Whether the guess stands out on the maps of more robots than these two, and on more wall than the two have in
    /// common.
    pub is_supported: bool,
}

impl Statement {
    /// A statement on a pair, of which the first by name becomes robot a if there is no guess that says which it is.
    pub(super) fn of(pair: (String, String), found: Result<Vec<(MapAlignment, String)>, String>) -> Self {
        let (a, b) = if pair.0 < pair.1 { pair } else { (pair.1, pair.0) };
        Self { a, b, found, is_supported: false }
    }
}

/// All guesses, each with what speaks for it.
pub(super) fn with_reasons(found: &MapAlignments) -> Vec<(MapAlignment, String)> {
    found.hypotheses.iter().enumerate().map(|(rank, found_at)| (found_at.clone(), found.reason(rank))).collect()
}

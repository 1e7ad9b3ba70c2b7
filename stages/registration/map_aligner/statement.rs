//! What is told of a pair of robots.

use crate::registration::search::{MapAlignment, MapAlignments};
use crate::shared::robot_pair::RobotPair;

/// What is to be told of a pair of robots.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// The pair, the first of the two by name as robot a.
    pub pair: RobotPair,
    /// Guesses, the best first, each with what speaks for it; or why there are none.
    pub found: Result<Vec<(MapAlignment, String)>, String>,
    /// Whether the guess stands out on the maps of more robots than these two, and on more wall than the two have in
    /// common.
    pub is_supported: bool,
}

impl Statement {
    /// A statement on a pair, by these two maps alone.
    pub(super) fn of(pair: RobotPair, found: Result<Vec<(MapAlignment, String)>, String>) -> Self {
        Self { pair, found, is_supported: false }
    }
}

/// All guesses, each with what speaks for it.
pub(super) fn with_reasons(found: &MapAlignments) -> Vec<(MapAlignment, String)> {
    found.hypotheses.iter().enumerate().map(|(rank, found_at)| (found_at.clone(), found.reason(rank))).collect()
}

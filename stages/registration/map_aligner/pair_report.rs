//! The hypotheses of a pair of robots.

use crate::registration::search::{MapAlignment, MapAlignments};
use crate::shared::robot_pair::RobotPair;

/// Hypotheses of a pair of robots, or why there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct PairReport {
    /// The pair, the first of the two by name as robot a.
    pub pair: RobotPair,
    /// Hypotheses with their reasons, the best first; or why there are none.
    pub found: Result<Vec<(MapAlignment, String)>, String>,
    /// Whether the peak is significant on the merged maps of more robots than these two, and on more wall than the
    /// two have in common.
    pub is_supported: bool,
}

impl PairReport {
    /// Report on a pair from the search of these two maps only.
    pub(super) fn of(pair: RobotPair, found: Result<Vec<(MapAlignment, String)>, String>) -> Self {
        Self { pair, found, is_supported: false }
    }
}

/// All hypotheses with their reasons.
pub(super) fn with_reasons(found: &MapAlignments) -> Vec<(MapAlignment, String)> {
    found.hypotheses.iter().enumerate().map(|(rank, found_at)| (found_at.clone(), found.reason(rank))).collect()
}

//! What is known of a place before the maps are compared.

use super::Candidate;
use crate::registration::Basis;

/// The log-odds that enough tags add.
const BY_TAGS: f64 = 10.0;
/// The log-odds that few tags add.
const BY_FEW_TAGS: f64 = 5.0;
/// The log-odds that initial poses add to a place that they allow.
const BY_INITIAL_POSES: f64 = 3.0;

/// The log-odds that tags add to a place, and the user if he expects the maps there.
pub(super) fn prior(candidate: &Candidate, is_expected: bool) -> f64 {
    let by_tags = match () {
        () if candidate.rests_on(|basis| basis == Basis::Tags) => BY_TAGS,
        () if candidate.rests_on(|basis| basis == Basis::FewTags) => BY_FEW_TAGS,
        () => 0.0,
    };
    by_tags + if is_expected { BY_INITIAL_POSES } else { 0.0 }
}

//! What is known of a place before the maps are compared.

use super::Candidate;
use crate::registration::Basis;

/// The log-odds that tags add. It was not fitted, as no recorded pairs with wrong tags are at hand: with the logarithm of 100 they decide
/// between two places that the maps fit equally well, and do not make a mirrored map or that of another building fit.
const BY_TAGS: f64 = 4.6;
/// The log-odds that initial poses add to a place that they allow: half as much, about.
const BY_INITIAL_POSES: f64 = 2.0;
/// The log-odds that it adds where enough tags and the best peak of the search come to the same place, each by itself: the logarithm of
/// 100, as even a small building has as many places that lie a metre or ten degrees apart.
const BY_COINCIDENCE: f64 = 4.6;

/// The log-odds that tags add to a place, and the user if he expects the maps there.
pub(super) fn prior(candidate: &Candidate, is_expected: bool) -> f64 {
    let has_tags = candidate.rests_on(|basis| basis == Basis::Tags);
    let is_best_peak =
        candidate.rests_on(|basis| matches!(basis, Basis::Search { significance } if significance > 0.0));
    let by_tags = if candidate.rests_on(Basis::is_by_tags) { BY_TAGS } else { 0.0 };
    let by_coincidence = if has_tags && is_best_peak { BY_COINCIDENCE } else { 0.0 };
    by_tags + by_coincidence + if is_expected { BY_INITIAL_POSES } else { 0.0 }
}

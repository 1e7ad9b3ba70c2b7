//! Prior log-odds of a hypothesis, before the maps are compared.

use super::Candidate;
use crate::registration::Basis;

/// Log-odds that tags add. It was not fitted, as no recorded pairs with wrong tags are available. With the logarithm
/// of 100 tags decide between two poses that the maps fit equally well, and do not make a mirrored map or that of
/// another building fit.
const BY_TAGS: f64 = 4.6;
/// Log-odds that initial poses add to a pose that they allow: about half as much.
const BY_INITIAL_POSES: f64 = 2.0;
/// Log-odds where enough tags and the best peak of the search independently give the same pose: the logarithm of 100,
/// as even a small building has as many poses that are a metre or ten degrees apart.
const BY_COINCIDENCE: f64 = 4.6;

/// Prior log-odds of a candidate from tags and from initial poses.
pub(super) fn prior(candidate: &Candidate, is_expected: bool) -> f64 {
    let has_tags = candidate.rests_on(|basis| basis == Basis::Tags);
    let is_best_peak =
        candidate.rests_on(|basis| matches!(basis, Basis::Search { significance, .. } if significance > 0.0));
    let by_tags = if candidate.rests_on(Basis::is_by_tags) { BY_TAGS } else { 0.0 };
    let by_coincidence = if has_tags && is_best_peak { BY_COINCIDENCE } else { 0.0 };
    by_tags + by_coincidence + if is_expected { BY_INITIAL_POSES } else { 0.0 }
}

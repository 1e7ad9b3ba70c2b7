//! How probable it is that an alignment is right.

use super::Agreement;

/// Weights of the logistic model.
const INTERCEPT: f64 = -6.0;
/// Per natural logarithm of the metres of wall that agree.
const BY_LENGTH: f64 = 2.0;
/// Per unit of the share of the walls that agree.
const BY_AGREEMENT: f64 = 12.0;
/// Per unit of the evidence elsewhere as a share of that here.
const BY_ELSEWHERE: f64 = -6.0;

/// The evidence for the best place elsewhere that is known, as a share of that for an alignment, 0 to 2.
pub fn elsewhere(agreement: &Agreement, rival: Option<&Agreement>, penalty: f64) -> f64 {
    let evidence = agreement.evidence(penalty).max(1.0);
    rival.map_or(0.0, |rival| (rival.evidence(penalty) / evidence).min(2.0))
}

/// The probability that an alignment is right (within 0.5 m and 1 degree of the truth), 0 to 1: a logistic model of the
/// length of the walls that agree, of the share of the walls that agree, and of what speaks for the best place
/// [`elsewhere`].
pub fn probability(agreement: &Agreement, elsewhere: f64) -> f64 {
    let length = agreement.wall_on_wall.max(1.0).ln();
    let odds =
        INTERCEPT + BY_LENGTH * length + BY_AGREEMENT * (agreement.wall_agreement() - 0.8) + BY_ELSEWHERE * elsewhere;
    1.0 / (1.0 + (-odds).exp())
}

//! How probable it is that an alignment is right.

use super::Agreement;

/// Weights of the logistic model, fitted by `gridweave experiment align --calibrate` to simulated pairs of maps.
const INTERCEPT: f64 = -6.0;
/// Per natural logarithm of the metres of wall that agree.
const BY_LENGTH: f64 = 2.0;
/// Per unit of the share of the walls that agree.
const BY_AGREEMENT: f64 = 12.0;
/// Per unit of the evidence elsewhere as a share of that here.
const BY_RIVAL: f64 = -6.0;

/// What the model is told of an alignment: ln of the metres of wall that agree, the share of the walls that agree (less
/// 0.8, about what parts right from wrong), and the evidence for the best place elsewhere as a share of that here.
pub fn features(agreement: &Agreement, rival: Option<&Agreement>, penalty: f64) -> [f64; 3] {
    let evidence = agreement.evidence(penalty).max(1.0);
    let rival = rival.map_or(0.0, |rival| (rival.evidence(penalty) / evidence).min(2.0));
    [agreement.wall_on_wall.max(1.0).ln(), agreement.wall_agreement() - 0.8, rival]
}

/// The probability that an alignment is right (within 0.5 m and 2 degrees of the truth), 0 to 1: a logistic model of
/// its [`features`]. `rival` is what the maps say of each other at the best place elsewhere that is known.
pub fn probability(agreement: &Agreement, rival: Option<&Agreement>, penalty: f64) -> f64 {
    let [length, share, elsewhere] = features(agreement, rival, penalty);
    let odds = INTERCEPT + BY_LENGTH * length + BY_AGREEMENT * share + BY_RIVAL * elsewhere;
    1.0 / (1.0 + (-odds).exp())
}

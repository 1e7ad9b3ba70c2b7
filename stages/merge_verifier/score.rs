//! How probable it is that an alignment is right.

use super::{Agreement, Rival};

/// Weights of the logistic model, fitted to simulated pairs of maps by the experiment `align --tuning --calibrate`.
const INTERCEPT: f64 = -2.869;
/// Per natural logarithm of the metres of wall that agree.
const BY_LENGTH: f64 = 1.128;
/// Per unit of the share of the walls that agree.
const BY_AGREEMENT: f64 = 11.789;
/// Per unit of [`evidence_elsewhere`].
const BY_EVIDENCE_ELSEWHERE: f64 = -6.339;
/// About the share of the walls that parts right alignments from wrong ones; subtracted, so that the weights hardly
/// depend on one another.
const MIDDLE_AGREEMENT: f64 = 0.8;

/// The most evidence for another place that is known, as a share of that for an alignment, 0 to 2.
pub fn evidence_elsewhere(agreement: &Agreement, rivals: impl Iterator<Item = Rival>, penalty: f64) -> f64 {
    let here = agreement.evidence(penalty).max(1.0);
    rivals.fold(0.0, |most, rival| most.max((rival.agreement.evidence(penalty) / here).min(2.0)))
}

/// The probability that an alignment is right (within 0.5 m and 1 degree of the truth), 0 to 1: a logistic model of the
/// length of the walls that agree, of their share, and of the [`evidence_elsewhere`].
pub fn probability(agreement: &Agreement, evidence_elsewhere: f64) -> f64 {
    let odds = INTERCEPT
        + BY_LENGTH * agreement.wall_on_wall.max(1.0).ln()
        + BY_AGREEMENT * (agreement.wall_agreement() - MIDDLE_AGREEMENT)
        + BY_EVIDENCE_ELSEWHERE * evidence_elsewhere;
    1.0 / (1.0 + (-odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agreement(wall_on_wall: f64, wall_on_free: f64) -> Agreement {
        Agreement { overlap: 200.0, wall_on_wall, wall_on_free, ..Default::default() }
    }

    #[test]
    fn more_wall_fewer_contradictions_and_poorer_rivals_make_an_alignment_more_probable() {
        let sure = probability(&agreement(200.0, 4.0), 0.0);
        assert!(sure > 0.99, "{sure}");
        assert!(probability(&agreement(60.0, 1.2), 0.0) < sure);
        assert!(probability(&agreement(200.0, 60.0), 0.0) < sure);
        let rival = Rival { shift: 5.0, turn: 0.0, agreement: agreement(190.0, 6.0) };
        let alike = evidence_elsewhere(&agreement(200.0, 4.0), std::iter::once(rival), 2.0);
        assert!((alike - 178.0 / 192.0).abs() < 1e-9);
        assert!(probability(&agreement(200.0, 4.0), alike) < 0.7);
        assert!(probability(&Agreement::default(), 0.0) < 0.5);
    }
}

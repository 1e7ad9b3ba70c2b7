//! How probable it is that an alignment is right.

use super::{Agreement, Rival};

/// Weights of the logistic model, fitted to simulated pairs of maps by `gridweave experiment align --tuning --calibrate`.
const INTERCEPT: f64 = -1.462;
/// Per natural logarithm of the metres of wall that agree.
const BY_LENGTH: f64 = 0.895;
/// Per unit of the share of the walls that agree.
const BY_AGREEMENT: f64 = 6.571;
/// Per unit of [`Elsewhere::evidence`].
const BY_EVIDENCE_ELSEWHERE: f64 = -5.611;
/// Per unit of [`Elsewhere::agreement`].
const BY_AGREEMENT_ELSEWHERE: f64 = 0.0;
/// About the share of the walls that parts right alignments from wrong ones; subtracted, so that the weights hardly
/// depend on one another.
const MIDDLE_AGREEMENT: f64 = 0.8;

/// What speaks for all other places that are known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elsewhere {
    /// The most evidence for one of them, as a share of that for the alignment, 0 to 2.
    pub evidence: f64,
    /// The largest share of the walls that agree at one of them, 0 to 1; only those count at which enough of the maps
    /// meets.
    pub agreement: f64,
}

impl Elsewhere {
    /// Of an alignment and the rivals that are known. `counts` says of which of them the share of the walls means something.
    pub(super) fn of(
        agreement: &Agreement,
        rivals: impl Iterator<Item = Rival>,
        penalty: f64,
        counts: impl Fn(&Rival) -> bool,
    ) -> Self {
        let here = agreement.evidence(penalty).max(1.0);
        rivals.fold(Self::default(), |elsewhere, rival| Self {
            evidence: elsewhere.evidence.max((rival.agreement.evidence(penalty) / here).min(2.0)),
            agreement: match counts(&rival) {
                true => elsewhere.agreement.max(rival.agreement.wall_agreement()),
                false => elsewhere.agreement,
            },
        })
    }
}

/// The probability that an alignment is right (within 0.5 m and 1 degree of the truth), 0 to 1: a logistic model of the
/// length of the walls that agree, of their share, and of what speaks for places elsewhere.
pub fn probability(agreement: &Agreement, elsewhere: &Elsewhere) -> f64 {
    let odds = INTERCEPT
        + BY_LENGTH * agreement.wall_on_wall.max(1.0).ln()
        + BY_AGREEMENT * (agreement.wall_agreement() - MIDDLE_AGREEMENT)
        + BY_EVIDENCE_ELSEWHERE * elsewhere.evidence
        + BY_AGREEMENT_ELSEWHERE * elsewhere.agreement;
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
        let nothing = Elsewhere::default();
        let sure = probability(&agreement(200.0, 4.0), &nothing);
        assert!(sure > 0.95, "{sure}");
        assert!(probability(&agreement(60.0, 1.2), &nothing) < sure);
        assert!(probability(&agreement(200.0, 60.0), &nothing) < sure);
        let rival = Rival { shift: 5.0, turn: 0.0, agreement: agreement(190.0, 6.0) };
        let alike = Elsewhere::of(&agreement(200.0, 4.0), std::iter::once(rival), 2.0, |_| true);
        assert!((alike.evidence - 178.0 / 192.0).abs() < 1e-9 && alike.agreement > 0.95);
        assert!(probability(&agreement(200.0, 4.0), &alike) < 0.8);
        assert_eq!(Elsewhere::of(&agreement(200.0, 4.0), std::iter::once(rival), 2.0, |_| false).agreement, 0.0);
        assert!(probability(&Agreement::default(), &nothing) < 0.5);
    }
}

//! Criterion by which the best hypothesis is accepted.

use super::RatedPose;

/// Requirements on the best hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Criterion {
    /// Its least omega, 0 to 1.
    pub min_omega: f64,
    /// Its least overlap, 0 to 1.
    pub min_overlap: f64,
}

/// Verdict on the hypotheses of a pair of maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Whether the best is accepted.
    pub accepted: bool,
    /// Reason for the user.
    pub reason: String,
}

impl Criterion {
    /// Sorts the best first: the greatest omega of those that overlap enough, then the others. Of equals the one with
    /// more cells in common comes first, and of those the first that was found.
    pub fn rank(&self, hypotheses: &mut [RatedPose]) {
        let overlaps = |one: &RatedPose| one.overlap >= self.min_overlap;
        hypotheses.sort_by(|one, other| {
            let omega = other.index.omega().total_cmp(&one.index.omega());
            let cells = other.index.known_in_both().cmp(&one.index.known_in_both());
            overlaps(other).cmp(&overlaps(one)).then(omega).then(cells)
        });
    }

    /// Judges the best of ranked hypotheses.
    pub fn judge(&self, ranked: &[RatedPose]) -> Judgement {
        let Some(best) = ranked.first() else { return refused("the maps fit nowhere".to_owned()) };
        let (omega, overlap) = (best.index.omega(), 100.0 * best.overlap);
        let found = format!("omega {omega:.3} at the best pose, where {overlap:.0} % of the smaller map overlap");
        if best.overlap < self.min_overlap {
            return refused(format!(
                "the maps overlap too little: {found}\nmissing: {:.0} % of overlap (min_overlap)\ntry: let one robot drive where the \
                 other was",
                100.0 * self.min_overlap
            ));
        }
        if omega < self.min_omega {
            return refused(format!(
                "the maps contradict each other: {found}\nmissing: omega {:.3} (min_omega)\ntry: drive one robot on where the other \
                 was, or another method",
                self.min_omega
            ));
        }
        let next = ranked.get(1).map_or_else(
            || "there is no other".to_owned(),
            |next| format!("the next has omega {:.3}", next.index.omega()),
        );
        let reason = format!("the maps alone: {found}, and {next}\n\nnothing else was checked");
        Judgement { accepted: true, reason }
    }
}

fn refused(reason: String) -> Judgement {
    Judgement { accepted: false, reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acceptance_index::AcceptanceIndex;
    use gridweave_stages::shared::geometry::Pose2;
    use nalgebra::Matrix3;

    fn hypothesis(agree: u64, disagree: u64, overlap: f64) -> RatedPose {
        let index = AcceptanceIndex { agree, disagree };
        RatedPose { transform_a_b: Pose2::identity(), covariance: Matrix3::identity(), index, overlap }
    }

    const CRITERION: Criterion = Criterion { min_omega: 0.9, min_overlap: 0.1 };

    #[test]
    fn places_with_little_overlap_come_last_and_the_others_by_omega() {
        let (few, worse, better, larger) =
            (hypothesis(9, 0, 0.01), hypothesis(80, 20, 0.2), hypothesis(95, 5, 0.2), hypothesis(190, 10, 0.3));
        let mut hypotheses = [few, worse, better, larger];
        CRITERION.rank(&mut hypotheses);
        assert_eq!(hypotheses, [larger, better, worse, few]);
    }

    #[test]
    fn a_refusal_names_what_is_missing() {
        for (hypotheses, accepted, text) in [
            (vec![], false, "fit nowhere"),
            (vec![hypothesis(9, 0, 0.01)], false, "overlap too little: omega 1.000"),
            (vec![hypothesis(80, 20, 0.2)], false, "missing: omega 0.900 (min_omega)"),
            (vec![hypothesis(90, 10, 0.1)], true, "there is no other"),
            (vec![hypothesis(95, 5, 0.2), hypothesis(80, 20, 0.2)], true, "and the next has omega 0.800"),
        ] {
            let judgement = CRITERION.judge(&hypotheses);
            assert!(judgement.accepted == accepted && judgement.reason.contains(text), "{judgement:?}");
        }
    }
}

//! What many outcomes come to.

use super::super::statistics::{mean, quantile};
use super::trial::Outcome;

/// A place that is further off is the mirror image or another wrong mode, metres.
pub(super) const MIRRORED: f64 = 0.3;
/// A tag is used for a merge from this certainty on (Tsardoulias et al., section 4.1.3).
const SURE: f64 = 0.75;
/// A place that is used for a merge should not be further off, metres.
const WRONG: f64 = 0.1;

/// What many outcomes come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    /// Mean of the certainties.
    pub(super) certainty: f64,
    /// Share of the tags that are in the window or block that is named.
    pub(super) in_window: f64,
    /// Median error, metres.
    pub(super) median: f64,
    /// 95 % of the errors are below, metres.
    pub(super) error_95: f64,
    /// Share of the places that are more than 0.3 m off.
    pub(super) mirrored: f64,
    /// Of the others, the share whose 95 % ellipse holds the tag.
    pub(super) in_ellipse: f64,
    /// Share of the places that are stated with a certainty of 0.75 or more and are more than 0.1 m off.
    pub(super) sure_and_wrong: f64,
    /// Share of the places that are stated with a certainty of 0.75 or more.
    pub(super) sure: f64,
}

impl Score {
    /// The columns of [`cells`](Self::cells).
    pub(super) const HEADS: [&'static str; 8] = [
        "certainty",
        "in window",
        "median error, m",
        "95 % error, m",
        "above 0.3 m",
        "in 95 % ellipse",
        "sure",
        "sure, above 0.1 m",
    ];

    /// The score of some outcomes.
    pub(super) fn new(outcomes: &[Outcome]) -> Self {
        let share = |count: usize, of: usize| count as f64 / of as f64;
        let count = |holds: fn(&&Outcome) -> bool| outcomes.iter().filter(holds).count();
        let errors: Vec<f64> = outcomes.iter().map(|outcome| outcome.error).collect();
        let near = count(|outcome| outcome.error <= MIRRORED);
        let all = outcomes.len();
        Self {
            certainty: mean(&outcomes.iter().map(|outcome| outcome.certainty).collect::<Vec<_>>()),
            in_window: share(count(|outcome| outcome.is_in_window), all),
            median: quantile(&errors, 0.5),
            error_95: quantile(&errors, 0.95),
            mirrored: share(all - near, all),
            in_ellipse: share(count(|outcome| outcome.error <= MIRRORED && outcome.is_in_ellipse), near),
            sure: share(count(|outcome| outcome.certainty >= SURE), all),
            sure_and_wrong: share(count(|outcome| outcome.certainty >= SURE && outcome.error > WRONG), all),
        }
    }

    /// The score as a table shows it.
    pub(super) fn cells(&self) -> [String; 8] {
        let share = |value: f64| format!("{value:.2}");
        let metres = |value: f64| format!("{value:.3}");
        [
            share(self.certainty),
            share(self.in_window),
            metres(self.median),
            metres(self.error_95),
            share(self.mirrored),
            share(self.in_ellipse),
            share(self.sure),
            share(self.sure_and_wrong),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outcomes_are_counted_by_hand() {
        let outcome =
            |certainty, error, is_in_ellipse| Outcome { certainty, error, is_in_ellipse, is_in_window: error < 0.03 };
        let score = Score::new(&[
            outcome(0.9, 0.0, true),
            outcome(0.8, 0.2, false),
            outcome(0.6, 0.02, true),
            outcome(0.7, 2.0, false),
        ]);
        assert!((score.certainty - 0.75).abs() < 1e-12 && (score.median - 0.11).abs() < 1e-12, "{score:?}");
        assert_eq!((score.in_window, score.mirrored, score.sure, score.sure_and_wrong), (0.5, 0.25, 0.5, 0.25));
        assert!((score.in_ellipse - 2.0 / 3.0).abs() < 1e-12);
    }
}

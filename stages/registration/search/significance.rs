//! Peak significance: how far a score exceeds all others of the same search.

/// Number of the best other scores by which the spread of poses that fit by chance is estimated.
pub(super) const OTHERS: usize = 20;
/// With fewer, the spread is estimated as this share of the score.
const LEAST_OTHERS: usize = 4;
const SHARE_FOR_SPREAD: f64 = 0.2;
/// Least spread, metres of wall: scores are not known better.
const LEAST_SPREAD: f64 = 0.3;

/// Peak significance of a score: its distance from the best of the others, which are given in descending order, in
/// units of their spread; below 0 if it is less.
///
/// The best of many scores by chance exceed any high threshold as exponential variables do, whatever the distribution
/// of all, if its tail is a common one (Pickands 1975; Embrechts and others, "Modelling Extremal Events", 1997).
/// Their scale is the mean excess over the last of them; and the best of them exceeds the next by more than `t` such
/// units with probability `exp(-t)`.
pub(super) fn significance(score: f64, others: &[f64]) -> f64 {
    let others = &others[..others.len().min(OTHERS)];
    let (Some(best), Some(last)) = (others.first(), others.last()) else {
        return score / (SHARE_FOR_SPREAD * score).max(LEAST_SPREAD);
    };
    let spread = match others.len() {
        count if count >= LEAST_OTHERS => others.iter().map(|other| other - last).sum::<f64>() / (count - 1) as f64,
        _ => SHARE_FOR_SPREAD * score,
    };
    (score - best) / spread.max(LEAST_SPREAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_significance_is_in_units_of_the_spread_of_the_others() {
        let others = [10.0, 9.0, 8.0, 7.0, 6.0];
        assert!((significance(15.0, &others) - 2.0).abs() < 1e-12);
        assert!(significance(8.0, &others) < 0.0);
        assert!(significance(15.0, &[14.5; 10]) < 2.0, "scores are known to some centimetres");
        assert!((significance(15.0, &[9.0]) - 2.0).abs() < 1e-12);
        assert!((significance(15.0, &[]) - 5.0).abs() < 1e-12);
        assert!(significance(0.0, &[]) == 0.0);
    }
}

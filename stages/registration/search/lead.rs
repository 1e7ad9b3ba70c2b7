//! How far a place leads all others of the same search.

/// So many of the best other places tell the spread of places that fit by chance.
pub(super) const OTHERS: usize = 20;
/// With fewer, their spread is not known, and this share of the score of the place stands for it.
const LEAST_OTHERS: usize = 4;
const SHARE_FOR_SPREAD: f64 = 0.2;
/// Metres of wall: scores are not known better.
const LEAST_SPREAD: f64 = 0.3;

/// How far a place with a score leads the others, whose scores are given from the best on, in units of their spread; below 0
/// if it does not.
///
/// Of many places that fit by chance the best ones lie above any high score as exponential variables do, whatever the
/// distribution of all, if only its tail is a common one (Pickands 1975; Embrechts and others, "Modelling Extremal Events",
/// 1997). Their scale is the mean of what they lie above the last of them; and the best of them leads the next by more than
/// `t` such units with the probability `exp(-t)`.
pub(super) fn lead(score: f64, others: &[f64]) -> f64 {
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
    fn a_lead_is_counted_in_the_spread_of_the_others() {
        let others = [10.0, 9.0, 8.0, 7.0, 6.0];
        assert!((lead(15.0, &others) - 2.0).abs() < 1e-12);
        assert!(lead(8.0, &others) < 0.0);
        assert!(lead(15.0, &[14.5; 10]) < 2.0, "what is alike is told to some centimetres");
        assert!((lead(15.0, &[9.0]) - 2.0).abs() < 1e-12);
        assert!((lead(15.0, &[]) - 5.0).abs() < 1e-12);
        assert!(lead(0.0, &[]) == 0.0);
    }
}

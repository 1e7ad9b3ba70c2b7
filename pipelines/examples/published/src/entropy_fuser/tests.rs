//! The filter.

use super::*;
use proptest::prelude::*;

/// Entropy of a cell that is occupied with the probability of these log-odds, in bits: 1 where nothing is known.
fn entropy(log_odds: f64) -> f64 {
    let of = |log_odds: f64| {
        let probability = 1.0 / (1.0 + (-log_odds).exp());
        if probability > 0.0 { -probability * probability.log2() } else { 0.0 }
    };
    of(log_odds) + of(-log_odds)
}

proptest! {
    #[test]
    fn what_is_kept_is_never_less_certain_than_the_better_input(a in -4f32..4.0, b in -4f32..4.0) {
        let (fused, best) = (entropy_filter(a, b), entropy(a.into()).min(entropy(b.into())));
        prop_assert!(entropy(fused.into()) <= best + 1e-6);
        let sum_is_better = entropy((a + b).into()) <= best;
        let better = if b.abs() > a.abs() { b } else { a };
        prop_assert_eq!(fused, if sum_is_better { a + b } else { better });
    }

    #[test]
    fn two_maps_give_the_same_in_either_order_unless_they_are_as_certain_of_the_opposite(a in -4f32..4.0, b in -4f32..4.0) {
        prop_assume!(a.abs() != b.abs());
        prop_assert_eq!(entropy_filter(a, b), entropy_filter(b, a));
    }
}

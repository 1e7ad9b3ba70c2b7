//! Probability that tags at random positions agree on a transform.

use super::TagPair;
use std::f64::consts::PI;

/// Expected number of sets of `agreeing` tags that would agree under one rigid transform, if the tags of map a were
/// at random in a disc of the same size: an upper bound of the probability of such a set by chance. At most 1.
///
/// It is the number of false alarms of Moisan and Stival 2004. A set begins with two tags, whose distance must be the
/// same in both maps; each further one must then be in its gate.
pub fn chance_of_agreement(pairs: &[TagPair], agreeing: usize, gate: f64) -> f64 {
    let count = pairs.len();
    if agreeing < 2 || agreeing > count {
        return 1.0;
    }
    let middle = pairs.iter().fold(nalgebra::Vector2::zeros(), |sum, pair| sum + pair.a.coords / count as f64);
    let radius = pairs.iter().map(|pair| (pair.a.coords - middle).norm()).fold(0.0, f64::max);
    let stddev = (pairs.iter().map(TagPair::variance).sum::<f64>() / count as f64).sqrt();
    let reach = gate * stddev;
    if !(radius > 0.0 && reach.is_finite()) {
        return 1.0;
    }
    // A gate is an area of pi reach^2 in the disc, and twice `reach * sqrt(2)` among distances up to the disc's
    // diameter.
    let in_gate = (PI * reach * reach / (PI * radius * radius)).min(1.0);
    let same_length = (2.0 * std::f64::consts::SQRT_2 * reach / (2.0 * radius)).min(1.0);
    let logarithm =
        ln_choose(count, agreeing) + ln_choose(agreeing, 2) + same_length.ln() + (agreeing - 2) as f64 * in_gate.ln();
    logarithm.exp().min(1.0)
}

/// Logarithm of the number of ways to choose `k` of `n`.
fn ln_choose(n: usize, k: usize) -> f64 {
    (0..k.min(n)).map(|index| ((n - index) as f64 / (index + 1) as f64).ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::Point2;
    use nalgebra::Matrix2;

    fn tags(count: usize, radius: f64) -> Vec<TagPair> {
        let covariance = Matrix2::from_diagonal_element(0.03 * 0.03);
        let pair = |index: usize| {
            let angle = 2.4 * index as f64;
            let a = Point2::new(radius * angle.cos(), radius * angle.sin());
            TagPair { a, b: a, covariance_a: covariance, covariance_b: covariance }
        };
        (0..count).map(pair).collect()
    }

    #[test]
    fn combinations_are_counted() {
        assert!((ln_choose(12, 3).exp() - 220.0).abs() < 1e-9);
        assert!((ln_choose(5, 5).exp() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn three_of_three_in_a_building_are_no_chance_but_three_of_fifty_are() {
        assert!(chance_of_agreement(&tags(3, 10.0), 3, 3.5) < 1e-4);
        assert!(chance_of_agreement(&tags(50, 10.0), 3, 3.5) > 0.1);
    }

    #[test]
    fn two_of_two_agree_by_chance_as_often_as_a_length_is_in_its_gate() {
        // About 20 m apart, to within 3.5 standard deviations of 0.06 m to either side.
        let chance = chance_of_agreement(&tags(2, 10.0), 2, 3.5);
        assert!(chance > 0.01 && chance < 0.05, "{chance}");
        assert!(chance_of_agreement(&tags(2, 1.0), 2, 3.5) > 0.1);
    }

    #[test]
    fn more_agreeing_tags_or_a_larger_area_are_less_likely_by_chance() {
        let tags_10 = tags(10, 10.0);
        let chances: Vec<f64> = (3..=10).map(|agreeing| chance_of_agreement(&tags_10, agreeing, 3.5)).collect();
        assert!(chances.windows(2).all(|two| two[1] < two[0]), "{chances:?}");
        assert!(chance_of_agreement(&tags(4, 1.0), 4, 3.5) > chance_of_agreement(&tags(4, 10.0), 4, 3.5));
    }

    #[test]
    fn invalid_input_counts_as_chance() {
        assert_eq!(chance_of_agreement(&[], 3, 3.5), 1.0);
        assert_eq!(chance_of_agreement(&tags(1, 10.0), 1, 3.5), 1.0);
        assert_eq!(chance_of_agreement(&tags(2, 10.0), 3, 3.5), 1.0);
        assert_eq!(chance_of_agreement(&tags(4, 0.0), 4, 3.5), 1.0);
    }
}

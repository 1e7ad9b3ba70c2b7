//! Numbers as text for the user.

/// The most decimals that a number gets.
const MOST_DECIMALS: usize = 6;

/// A value and its bound with `decimals`, or as many more as it takes for them to differ: "0.304 m, and 0.300 m are
/// allowed".
pub fn beside_bound(value: f64, bound: f64, decimals: usize) -> [String; 2] {
    let with = |decimals: usize| [value, bound].map(|number| format!("{number:.decimals$}"));
    let differ = |texts: &[String; 2]| texts[0] != texts[1];
    (decimals..=MOST_DECIMALS).map(with).find(differ).unwrap_or_else(|| with(decimals))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_and_its_bound_differ_as_texts_if_they_differ_as_numbers() {
        assert_eq!(beside_bound(0.5, 0.3, 2), ["0.50", "0.30"]);
        assert_eq!(beside_bound(0.3041, 0.3, 2), ["0.304", "0.300"]);
        assert_eq!(beside_bound(3.8, 4.0, 0), ["3.8", "4.0"]);
        assert_eq!(beside_bound(0.3, 0.3, 2), ["0.30", "0.30"]);
        assert_eq!(beside_bound(f64::NAN, 0.3, 1), ["NaN", "0.3"]);
        assert_eq!(beside_bound(f64::INFINITY, 0.3, 2), ["inf", "0.30"]);
    }
}

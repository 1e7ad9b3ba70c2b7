//! Log-odds of probabilities.

/// `ln(p / (1 - p))`: 0 for one half.
pub fn log_odds(probability: f64) -> f64 {
    (probability / (1.0 - probability)).ln()
}

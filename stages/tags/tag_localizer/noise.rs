//! The noise of readings, by their residuals.

/// Residual in standard deviations at which a reading counts half.
const HALF_WEIGHT: f64 = 2.0;
/// Factor from the median absolute deviation to the standard deviation of a normal distribution.
const MAD_TO_STDDEV: f64 = 1.4826;
/// Largest number of readings in a row that count as one, as their errors are correlated.
const MOST_CORRELATED: f64 = 20.0;

/// How the readings of a tag are weighed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// Factor of their standard deviations.
    pub(super) factor: f64,
    /// The number of readings in a row that count as one.
    pub(super) correlated: f64,
}

impl Noise {
    /// What the readings claim.
    pub(super) const CLAIMED: Self = Self { factor: 1.0, correlated: 1.0 };

    /// The noise of readings with these residuals, in the standard deviations that they claim and in the order of the
    /// drive: at least what they claim.
    pub(super) fn of(residuals: &[f64]) -> Self {
        let mut sizes: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let factor = (MAD_TO_STDDEV * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)).max(1.0);
        // Echoes are not part of the correlation.
        let usual: Vec<f64> = residuals.iter().map(|residual| (residual / factor).clamp(-3.0, 3.0)).collect();
        let squares: f64 = usual.iter().map(|one| one * one).sum();
        let products: f64 = usual.iter().zip(usual.iter().skip(1)).map(|(one, next)| one * next).sum();
        let correlation = (products / squares.max(f64::MIN_POSITIVE)).clamp(0.0, 0.99);
        let correlated = ((1.0 + correlation) / (1.0 - correlation)).min(MOST_CORRELATED);
        Self { factor, correlated }
    }
}

/// Cauchy weight of a residual in standard deviations.
pub(super) fn weight(residual: f64) -> f64 {
    1.0 / (1.0 + (residual / HALF_WEIGHT).powi(2))
}

/// Negative log-likelihood of a residual in standard deviations, by which it has that weight.
pub(super) fn cost(residual: f64) -> f64 {
    0.5 * HALF_WEIGHT * HALF_WEIGHT * (residual / HALF_WEIGHT).powi(2).ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_that_follow_each_other_count_less() {
        let alternate: Vec<f64> = (0..100).map(|step| if step % 2 == 0 { 3.0 } else { -3.0 }).collect();
        let slow: Vec<f64> = (0..100).map(|step| if step % 50 < 25 { 3.0 } else { -3.0 }).collect();
        assert_eq!(Noise::of(&alternate).correlated, 1.0);
        let noise = Noise::of(&slow);
        assert!(noise.correlated > 5.0 && (noise.factor - 3.0 * MAD_TO_STDDEV).abs() < 1e-9, "{noise:?}");
        assert_eq!(Noise::of(&[]), Noise::CLAIMED);
    }

    #[test]
    fn the_weight_is_the_slope_of_the_cost() {
        for residual in [0.1, 1.0, 5.0] {
            let slope = (cost(residual + 1e-6) - cost(residual - 1e-6)) / 2e-6;
            assert!((slope - weight(residual) * residual).abs() < 1e-6);
        }
    }
}

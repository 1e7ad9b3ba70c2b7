//! Statistics of samples.

/// With a correct covariance, 95 % of the normalised squared errors in x, y and yaw are below this (chi-squared with three
/// degrees of freedom).
pub(super) const NORMALISED_95: f64 = 7.815;

/// The mean; no number for no samples.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The standard deviation of a sample (with n - 1); no number for less than two samples.
pub(super) fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

/// Quantile of the samples, linear between neighbours; no number for no samples.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

/// The median; no number for no samples.
pub(super) fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The 95 % interval of a probability of which `successes` out of `trials` were seen (Wilson 1927).
pub(super) fn wilson_interval(successes: usize, trials: usize) -> (f64, f64) {
    if trials == 0 {
        return (0.0, 1.0);
    }
    let z = 1.959_963_985;
    let (n, share) = (trials as f64, successes as f64 / trials as f64);
    let scale = 1.0 + z * z / n;
    let middle = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    (((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_sample_by_hand() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(mean(&values), 2.5);
        assert!((standard_deviation(&values) - (5.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!((quantile(&values, 0.0), median(&values), quantile(&values, 1.0)), (1.0, 2.5, 4.0));
        assert!(mean(&[]).is_nan() && median(&[]).is_nan() && standard_deviation(&[1.0]).is_nan());
    }

    #[test]
    fn the_interval_holds_the_share_and_narrows_with_more_trials() {
        let (low, high) = wilson_interval(9, 10);
        assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
        let (low, high) = wilson_interval(1000, 1000);
        assert!(low > 0.995 && high > 0.999_999);
        assert_eq!(wilson_interval(0, 0), (0.0, 1.0));
    }
}

//! Drift of a SLAM system's poses.
//!
//! Heading and distance have random walks over the driven distance, and the accumulated error decays over a length,
//! as loop closures correct drift. The error of every coordinate is thus a mean-reverting random walk (an
//! Ornstein-Uhlenbeck process in the driven distance): maps are deformed a little, and do not drift away.

use crate::shared::geometry::{Pose2, pose, wrap_angle};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Parameters of the drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PoseDrift {
    /// Standard deviation after one metre of driving: of the heading in radians, and of the distance in metres. It
    /// grows with the root of the way. A turn of one radian counts as a tenth of a metre.
    pub(super) deviation: f64,
    /// Driven distance over which an error decays to 37 %, metres; 0 for no correction.
    pub(super) correction_length: f64,
}

/// Estimated poses for the true poses `truth`. The first is exact.
pub(super) fn estimate_poses(truth: &[Pose2], drift: &PoseDrift, random: &mut impl Rng) -> Vec<Pose2> {
    let Some(first) = truth.first() else { return Vec::new() };
    let mut estimates = Vec::with_capacity(truth.len());
    estimates.push(*first);
    let mut estimate = *first;
    for pair in truth.windows(2) {
        let step = pair[0].inv_mul(&pair[1]);
        let way = step.translation.vector.norm() + 0.1 * step.rotation.angle().abs();
        let deviation = drift.deviation * way.sqrt();
        let stretch: f64 = random.sample(StandardNormal);
        let turn: f64 = random.sample(StandardNormal);
        let moved = estimate * step * pose(deviation * stretch, 0.0, deviation * turn);
        let kept = if drift.correction_length > 0.0 { (-way / drift.correction_length).exp() } else { 1.0 };
        let error = moved.translation.vector - pair[1].translation.vector;
        let heading = pair[1].rotation.angle();
        let turned = wrap_angle(moved.rotation.angle() - heading);
        let place = pair[1].translation.vector + error * kept;
        estimate = pose(place.x, place.y, heading + turned * kept);
        estimates.push(estimate);
    }
    estimates
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn circle() -> Vec<Pose2> {
        (0..5000).map(|i| f64::from(i) * 0.01).map(|a| pose(5.0 * a.cos(), 5.0 * a.sin(), a + 1.57)).collect()
    }

    fn worst(drift: PoseDrift) -> f64 {
        let truth = circle();
        let estimates = estimate_poses(&truth, &drift, &mut ChaCha8Rng::seed_from_u64(3));
        assert_eq!(estimates.len(), truth.len());
        let errors = truth.iter().zip(&estimates).map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
        errors.fold(0.0, f64::max)
    }

    #[test]
    fn without_drift_poses_are_exact() {
        assert!(worst(PoseDrift { deviation: 0.0, correction_length: 0.0 }) < 1e-9);
    }

    #[test]
    fn corrections_keep_an_error_small_that_would_grow() {
        let corrected = worst(PoseDrift { deviation: 0.01, correction_length: 10.0 });
        let free = worst(PoseDrift { deviation: 0.01, correction_length: 0.0 });
        assert!(corrected > 0.01 && corrected < 0.5, "{corrected}");
        assert!(free > 2.0 * corrected, "{free}");
    }

    #[test]
    fn no_poses_have_no_estimates() {
        let drift = PoseDrift { deviation: 0.01, correction_length: 10.0 };
        assert!(estimate_poses(&[], &drift, &mut ChaCha8Rng::seed_from_u64(3)).is_empty());
    }
}

//! Odometry of wheels: it drifts without bound, as nothing corrects it.

use super::shape::between;
use crate::shared::geometry::{Pose2, pose};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// A turn of one radian has the errors of so much way, metres.
const WAY_OF_TURN: f64 = 0.1;
/// The largest slip, metres and radians.
const LARGEST_SLIP: [f64; 2] = [0.3, 0.4];

/// Errors of odometry. Each robot has its own systematic ones, for its whole drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OdometryErrors {
    /// Standard deviation over robots of the distance's scale, and of the turn's.
    pub(super) scale: [f64; 2],
    /// Standard deviation over robots of the turn that wheels of unequal size add, radians a metre.
    pub(super) yaw_drift: f64,
    /// Standard deviation after one metre of what is not systematic, metres and radians; it grows with the root of the
    /// way.
    pub(super) noise: f64,
    /// Mean number of slips on 100 metres.
    pub(super) slips: f64,
}

/// Poses by odometry for the true poses `truth`. The first is exact.
pub(super) fn wheel_odometry(truth: &[Pose2], errors: &OdometryErrors, random: &mut impl Rng) -> Vec<Pose2> {
    let Some(first) = truth.first() else { return Vec::new() };
    let [scale, turn_scale] = errors.scale.map(|deviation| 1.0 + normal(random, deviation));
    let yaw_drift = normal(random, errors.yaw_drift);
    let mut estimates = Vec::with_capacity(truth.len());
    estimates.push(*first);
    let mut estimate = *first;
    for pair in truth.windows(2) {
        let step = pair[0].inv_mul(&pair[1]);
        let (moved, turned) = (step.translation.vector, step.rotation.angle());
        let way = moved.norm() + WAY_OF_TURN * turned.abs();
        let deviation = errors.noise * way.sqrt();
        let mut along = normal(random, deviation);
        let mut yaw = yaw_drift * moved.norm() + normal(random, deviation);
        if random.random_bool((errors.slips * way / 100.0).min(1.0)) {
            // Wheels that slip count more way than there is.
            along += between(random, 0.0, LARGEST_SLIP[0]);
            yaw += between(random, -LARGEST_SLIP[1], LARGEST_SLIP[1]);
        }
        estimate *= pose(scale * moved.x + along, scale * moved.y, turn_scale * turned + yaw);
        estimates.push(estimate);
    }
    estimates
}

fn normal(random: &mut impl Rng, deviation: f64) -> f64 {
    deviation * random.sample::<f64, _>(StandardNormal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const EXACT: OdometryErrors = OdometryErrors { scale: [0.0; 2], yaw_drift: 0.0, noise: 0.0, slips: 0.0 };

    /// Twenty metres straight on.
    fn straight() -> Vec<Pose2> {
        (0..=400).map(|step| pose(f64::from(step) * 0.05, 0.0, 0.0)).collect()
    }

    /// Root mean square of the error of the last pose over robots: position, metres, and yaw, radians.
    fn deviation(errors: OdometryErrors) -> [f64; 2] {
        let truth = straight();
        let mut sums = [0.0; 2];
        for seed in 0..400 {
            let estimates = wheel_odometry(&truth, &errors, &mut ChaCha8Rng::seed_from_u64(seed));
            assert_eq!((estimates.len(), estimates[0]), (truth.len(), truth[0]));
            let off = truth[400].inv_mul(&estimates[400]);
            sums[0] += off.translation.vector.norm_squared() / 400.0;
            sums[1] += off.rotation.angle().powi(2) / 400.0;
        }
        sums.map(f64::sqrt)
    }

    #[test]
    fn each_error_grows_as_it_is_said_to() {
        let [place, yaw] = deviation(EXACT);
        assert!(place < 1e-9 && yaw < 1e-9);
        let is_about = |value: f64, expected: f64| (value / expected - 1.0).abs() < 0.15;
        let [place, yaw] = deviation(OdometryErrors { scale: [0.03, 0.5], ..EXACT });
        assert!(is_about(place, 20.0 * 0.03) && yaw < 1e-9, "{place} {yaw}");
        let [_, yaw] = deviation(OdometryErrors { yaw_drift: 0.01, ..EXACT });
        assert!(is_about(yaw, 20.0 * 0.01), "{yaw}");
        let [_, yaw] = deviation(OdometryErrors { noise: 0.05, ..EXACT });
        assert!(is_about(yaw, 20f64.sqrt() * 0.05), "{yaw}");
        // One slip in the mean, of a yaw that is uniform.
        let [_, yaw] = deviation(OdometryErrors { slips: 5.0, ..EXACT });
        assert!(is_about(yaw, LARGEST_SLIP[1] / 3f64.sqrt()), "{yaw}");
    }

    #[test]
    fn turns_have_a_scale_of_their_own() {
        let truth: Vec<Pose2> = (0..=100).map(|step| pose(0.0, 0.0, f64::from(step) * 0.01)).collect();
        let errors = OdometryErrors { scale: [0.5, 0.1], ..EXACT };
        let estimates = wheel_odometry(&truth, &errors, &mut ChaCha8Rng::seed_from_u64(1));
        let off = truth[100].inv_mul(&estimates[100]);
        assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle().abs() > 1e-3, "{off}");
        assert!(wheel_odometry(&[], &errors, &mut ChaCha8Rng::seed_from_u64(1)).is_empty());
    }
}

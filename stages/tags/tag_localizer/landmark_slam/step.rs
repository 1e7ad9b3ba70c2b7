//! A step of the odometry between two keyframes, and how its error grows.

use crate::shared::geometry::{Pose2, quarter_turn};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Metres for a radian that a robot turns, in the drift of its position.
const WAY_BY_TURN: f64 = 0.5;
/// Least standard deviation of a step, metres and radians: without drift, nothing else is left.
const LEAST_DEVIATION: [f64; 2] = [1e-4, 1e-5];
/// Least standard deviation of systematic errors, per metre: over a kilometre a centimetre and a milliradian.
const LEAST_SYSTEMATIC: [f64; 2] = [1e-5, 1e-6];

/// How far odometry drifts: standard deviations after a metre, which grow with the root of the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OdometryDrift {
    /// Metres.
    pub(super) position: f64,
    /// Radians, also after a radian.
    pub(super) yaw: f64,
}

impl OdometryDrift {
    /// No drift.
    pub(super) const NONE: Self = Self { position: 0.0, yaw: 0.0 };

    /// Information on the systematic errors of a drive: what odometry drifts by in one metre by chance, it may drift by
    /// in each.
    pub(super) fn systematic_information(&self) -> Vector3<f64> {
        let [least, least_yaw] = LEAST_SYSTEMATIC;
        let (position, yaw) = (self.position.max(least).powi(-2), self.yaw.max(least_yaw).powi(-2));
        Vector3::new(position, yaw, yaw)
    }
}

/// Systematic errors of an odometry: its scale, radians for each metre, and radians for each radian.
pub(super) type Systematic = Vector3<f64>;

/// A step of the odometry: its transform, and the moments of the way by which errors on it move its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OdometryStep {
    /// From the keyframe before to this one.
    pub(super) transform: Pose2,
    /// Metres driven.
    pub(super) way: f64,
    /// Radians turned, to either side.
    pub(super) turned: f64,
    /// Sum of the parts of the way, metres and radians, each times its place in the frame of the keyframe before.
    first_moment: Vector2<f64>,
    /// The same with the squares of the places.
    second_moment: Matrix2<f64>,
}

impl OdometryStep {
    /// No step.
    pub(super) fn none() -> Self {
        Self {
            transform: Pose2::identity(),
            way: 0.0,
            turned: 0.0,
            first_moment: Vector2::zeros(),
            second_moment: Matrix2::zeros(),
        }
    }

    /// A short step, on which errors arise at its end.
    pub(super) fn short(transform: Pose2) -> Self {
        let mut step =
            Self { way: transform.translation.vector.norm(), turned: transform.rotation.angle().abs(), ..Self::none() };
        let place = transform.translation.vector;
        (step.first_moment, step.second_moment) = (step.length() * place, step.length() * place * place.transpose());
        Self { transform, ..step }
    }

    /// The way that counts for errors of the yaw.
    fn length(&self) -> f64 {
        self.way + self.turned
    }

    /// This step and then another one.
    pub(super) fn then(&self, next: &Self) -> Self {
        let (place, turn) = (self.transform.translation.vector, self.transform.rotation.to_rotation_matrix());
        let moved = turn * next.first_moment;
        let second = turn * next.second_moment * turn.inverse().matrix()
            + moved * place.transpose()
            + place * moved.transpose()
            + next.length() * place * place.transpose();
        Self {
            transform: self.transform * next.transform,
            way: self.way + next.way,
            turned: self.turned + next.turned,
            first_moment: self.first_moment + moved + next.length() * place,
            second_moment: self.second_moment + second,
        }
    }

    /// Covariance (x, y, yaw) of the step, in the frame of the keyframe before: an error of the yaw on the way turns
    /// what follows.
    pub(super) fn covariance(&self, drift: &OdometryDrift) -> Matrix3<f64> {
        let end = self.transform.translation.vector;
        let arms = self.second_moment - self.first_moment * end.transpose() - end * self.first_moment.transpose()
            + self.length() * end * end.transpose();
        // A quarter turn of both sides.
        let turned = Matrix2::new(arms.m22, -arms.m12, -arms.m21, arms.m11);
        let lever = quarter_turn(&(self.length() * end - self.first_moment));
        let [least, least_yaw] = LEAST_DEVIATION;
        let (yaw, position) = (drift.yaw.powi(2), drift.position.powi(2) * (self.way + WAY_BY_TURN * self.turned));
        let mut covariance = Matrix3::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&(turned * yaw));
        covariance.fixed_view_mut::<2, 1>(0, 2).copy_from(&(lever * yaw));
        covariance.fixed_view_mut::<1, 2>(2, 0).copy_from(&(lever.transpose() * yaw));
        covariance[(2, 2)] = yaw * self.length() + least_yaw * least_yaw;
        for axis in 0..2 {
            covariance[(axis, axis)] += position + least * least;
        }
        covariance
    }

    /// The step without systematic errors, and its derivatives by them.
    pub(super) fn corrected(&self, systematic: &Systematic) -> (Pose2, Matrix3<f64>) {
        let place = self.transform.translation.vector;
        let turn = self.transform.rotation.angle();
        // In the middle, half of the error has arisen.
        let lever = 0.5 * quarter_turn(&place);
        let more = systematic[1] * self.way + systematic[2] * turn;
        let moved = place * (1.0 + systematic[0]) + lever * more;
        let corrected = Pose2::new(moved, turn + more);
        let derivatives = Matrix3::from_columns(&[
            Vector3::new(place.x, place.y, 0.0),
            Vector3::new(lever.x, lever.y, 1.0) * self.way,
            Vector3::new(lever.x, lever.y, 1.0) * turn,
        ]);
        (corrected, derivatives)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// A quarter of a circle of 4 m, in short steps.
    fn curve() -> Vec<Pose2> {
        vec![pose(0.1, 0.0, 0.025); 63]
    }

    #[test]
    fn the_covariance_is_that_of_many_drives() {
        let steps = curve();
        let whole = steps.iter().fold(OdometryStep::none(), |sum, step| sum.then(&OdometryStep::short(*step)));
        let drift = OdometryDrift { position: 0.01, yaw: 0.02 };
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let noise = Normal::new(0.0, 1.0).unwrap();
        let mut sum = Matrix3::zeros();
        for _ in 0..4000 {
            let mut found = Pose2::identity();
            for step in &steps {
                let short = OdometryStep::short(*step);
                let spread = drift.position * (short.way + WAY_BY_TURN * short.turned).sqrt();
                let yaw = drift.yaw * short.length().sqrt() * noise.sample(&mut random);
                found =
                    found * step * pose(spread * noise.sample(&mut random), spread * noise.sample(&mut random), yaw);
            }
            let off = found.translation.vector - whole.transform.translation.vector;
            let off = Vector3::new(off.x, off.y, found.rotation.angle() - whole.transform.rotation.angle());
            sum += off * off.transpose() / 4000.0;
        }
        let covariance = whole.covariance(&drift);
        assert!((sum - covariance).norm() < 0.1 * covariance.norm(), "{sum} {covariance}");
    }

    #[test]
    fn two_halves_are_the_whole() {
        let steps = curve();
        let sum = |steps: &[Pose2]| {
            steps.iter().fold(OdometryStep::none(), |sum, step| sum.then(&OdometryStep::short(*step)))
        };
        let drift = OdometryDrift { position: 0.01, yaw: 0.02 };
        let (halves, whole) = (sum(&steps[..20]).then(&sum(&steps[20..])), sum(&steps));
        assert!((halves.covariance(&drift) - whole.covariance(&drift)).norm() < 1e-12);
    }

    #[test]
    fn derivatives_by_systematic_errors_are_those_of_the_step() {
        let step = OdometryStep::short(pose(1.0, 0.5, 0.4));
        let (_, derivatives) = step.corrected(&Systematic::zeros());
        for part in 0..3 {
            let mut by = Systematic::zeros();
            by[part] = 1e-6;
            let (high, low) = (step.corrected(&by).0, step.corrected(&-by).0);
            let off = (high.translation.vector - low.translation.vector) / 2e-6;
            let turn = (high.rotation.angle() - low.rotation.angle()) / 2e-6;
            assert!((Vector3::new(off.x, off.y, turn) - derivatives.column(part)).norm() < 1e-6);
        }
    }
}

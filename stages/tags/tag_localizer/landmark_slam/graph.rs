//! An estimate of the keyframes, the tags and the calibration of the radio, and the most probable one.

use super::super::TagLocalizerParameters;
use super::super::measured::Measured;
use super::super::noise::{Noise, cost, weight};
use super::keyframes::{KeyframeReading, Keyframes};
use super::residuals::ReadingFactor;
use super::step::{OdometryDrift, Systematic};
use crate::shared::geometry::{Point2, Pose2, relative_pose};
use crate::shared::sparse::{BlockCholesky, Columns, factor};
use nalgebra::{DMatrix, Matrix2, Matrix3, UnitComplex, Vector2, Vector3};

/// Largest number of steps to an optimum.
const MAX_STEPS: usize = 30;
/// Steps shorter than this end the iteration, metres and radians.
const LEAST_STEP: f64 = 1e-4;
/// Steps that make the estimate more probable by less end it, too: by this in the logarithm.
const LEAST_GAIN: f64 = 1e-3;
/// Information on the first pose, which fixes the frame.
const FIXED: f64 = 1e12;
/// Damping of the first step, as a share of the diagonal; each step changes it by a factor.
const FIRST_DAMPING: f64 = 1e-6;
const DAMPING_FACTOR: f64 = 10.0;
const MOST_DAMPING: f64 = 1e3;
/// An estimate of the first keyframes of a drive, the tags that are located so far, and the calibration.
#[derive(Clone, Debug)]
pub(super) struct LandmarkGraph<'a> {
    drive: &'a Keyframes,
    parameters: &'a TagLocalizerParameters,
    pub(super) poses: Vec<Pose2>,
    pub(super) tags: Vec<Option<Point2>>,
    /// Offset of ranges, metres, and their scale.
    pub(super) calibration: Vector2<f64>,
    /// What is systematic in the errors of the odometry.
    systematic: Systematic,
    pub(super) drift: OdometryDrift,
    /// By tag and kind of measurement.
    pub(super) noise: Vec<[Noise; Measured::KINDS]>,
}

/// Normal equations, whose unknowns are the keyframes, the tags, the calibration and the systematic errors of the
/// odometry, in this order: then the factor has no more than a column of tags for each keyframe.
struct LandmarkEquations {
    /// Number of the keyframes, and of the tags.
    poses: usize,
    tags: usize,
    /// Blocks below the diagonal.
    columns: Columns,
    diagonal: Vec<Matrix3<f64>>,
    negative_gradient: Vec<Vector3<f64>>,
}

impl<'a> LandmarkGraph<'a> {
    /// A graph of the first keyframe.
    pub(super) fn new(drive: &'a Keyframes, parameters: &'a TagLocalizerParameters, drift: OdometryDrift) -> Self {
        Self {
            drive,
            parameters,
            poses: drive.keyframes.first().map(|first| first.odometry).into_iter().collect(),
            tags: vec![None; drive.tags.len()],
            calibration: Vector2::zeros(),
            systematic: Systematic::zeros(),
            drift,
            noise: vec![[Noise::CLAIMED; Measured::KINDS]; drive.tags.len()],
        }
    }

    /// The same under another drift.
    pub(super) fn with_drift(&self, drift: OdometryDrift) -> Self {
        Self { drift, ..self.clone() }
    }

    /// The same with the noise of another one.
    pub(super) fn with_noise_of(&self, other: &Self) -> Self {
        Self { noise: other.noise.clone(), ..self.clone() }
    }

    /// The same with the keyframes as the odometry has them.
    pub(super) fn without_drift(&self) -> Self {
        let poses = self.drive.keyframes.iter().map(|keyframe| keyframe.odometry).collect();
        Self { poses, drift: OdometryDrift::NONE, systematic: Systematic::zeros(), ..self.clone() }
    }

    /// Adds keyframes by the odometry, up to a number.
    pub(super) fn extend(&mut self, count: usize) {
        while self.poses.len() < count {
            let (step, _) = self.drive.keyframes[self.poses.len()].step.corrected(&self.systematic);
            let Some(last) = self.poses.last() else { return };
            self.poses.push(last * step);
        }
    }

    /// The readings at the keyframes so far.
    pub(super) fn readings(&self) -> &'a [KeyframeReading] {
        let end = self.drive.readings.partition_point(|reading| reading.keyframe < self.poses.len());
        &self.drive.readings[..end]
    }

    fn rows(&self, reading: &KeyframeReading, noise: &Noise) -> Option<ReadingFactor> {
        let tag = self.tags[reading.tag].as_ref()?;
        let pose_stddev = self.parameters.pose_stddev;
        let keyframe = &self.poses[reading.keyframe];
        Some(ReadingFactor::new(reading, keyframe, tag, &self.calibration, pose_stddev, noise.factor))
    }

    fn noise(&self, reading: &KeyframeReading) -> &Noise {
        &self.noise[reading.tag][usize::from(reading.measured.kind())]
    }

    /// Information on the calibration.
    fn calibration_prior(&self) -> Vector2<f64> {
        let TagLocalizerParameters { offset_stddev, scale_stddev, .. } = *self.parameters;
        Vector2::new(offset_stddev, scale_stddev).map(|stddev| stddev.max(1e-9).powi(-2))
    }

    /// The information of a step of the odometry (x, y, yaw).
    fn step_information(&self, to: usize) -> Option<Matrix3<f64>> {
        self.drive.keyframes[to].step.covariance(&self.drift).try_inverse()
    }

    /// The residual of a step, and its derivative by the systematic errors.
    fn step_residual(&self, to: usize) -> (Vector3<f64>, Matrix3<f64>) {
        let (step, by_systematic) = self.drive.keyframes[to].step.corrected(&self.systematic);
        (relative_pose::residual(&self.poses[to - 1], &self.poses[to], &step), -by_systematic)
    }

    /// Negative logarithm of the probability of the readings and the steps, but for a constant.
    fn cost(&self) -> f64 {
        let steps = (1..self.poses.len()).map(|to| {
            let (residual, _) = self.step_residual(to);
            // Without information the estimate has no probability.
            self.step_information(to).map_or(f64::NAN, |information| 0.5 * residual.dot(&(information * residual)))
        });
        let readings = self.readings().iter().filter_map(|reading| {
            let noise = self.noise(reading);
            Some(cost(self.rows(reading, noise)?.squared().sqrt()) / noise.correlated)
        });
        let calibration = 0.5 * self.calibration.component_mul(&self.calibration).dot(&self.calibration_prior());
        let systematic = self.systematic.component_mul(&self.systematic);
        let systematic = 0.5 * systematic.dot(&self.drift.systematic_information());
        steps.sum::<f64>() + readings.sum::<f64>() + calibration + systematic
    }

    fn equations(&self) -> LandmarkEquations {
        let mut equations = LandmarkEquations::of_fixed_frame(self.poses.len(), self.tags.len());
        self.add_odometry(&mut equations);
        self.add_readings(&mut equations);
        self.add_priors(&mut equations);
        equations
    }

    fn add_odometry(&self, equations: &mut LandmarkEquations) {
        let systematic = equations.systematic();
        for to in 1..self.poses.len() {
            let Some(information) = self.step_information(to) else { continue };
            let (residual, by_systematic) = self.step_residual(to);
            let [by_from, by_to] = relative_pose::derivatives(&self.poses[to - 1], &self.poses[to]);
            let parts = [(to - 1, by_from), (to, by_to), (systematic, by_systematic)];
            for (row, by_row) in &parts {
                let weighted = by_row.transpose() * information;
                equations.negative_gradient[*row] -= weighted * residual;
                equations.diagonal[*row] += weighted * by_row;
                for (column, by_column) in parts.iter().filter(|(column, _)| column < row) {
                    equations.columns[*column].push((*row, weighted * by_column));
                }
            }
        }
    }

    fn add_readings(&self, equations: &mut LandmarkEquations) {
        let tags = self.tags.len();
        let calibration = equations.calibration();
        let mut with_calibration = vec![Matrix3::zeros(); tags];
        for of_one in self.readings().chunk_by(|a, b| a.keyframe == b.keyframe) {
            let keyframe = of_one[0].keyframe;
            // The last one is with the calibration.
            let mut with_tags = vec![Matrix3::zeros(); tags + 1];
            for reading in of_one {
                let noise = self.noise(reading);
                let Some(rows) = self.rows(reading, noise) else { continue };
                let weight = weight(rows.squared().sqrt()) / noise.correlated;
                let (number, tag) = (reading.tag, equations.tag(reading.tag));
                let LandmarkEquations { diagonal, negative_gradient, .. } = &mut *equations;
                for row in rows.iter() {
                    let by_tag = Vector3::new(row.by_tag.x, row.by_tag.y, 0.0);
                    let by_calibration = Vector3::new(row.by_calibration.x, row.by_calibration.y, 0.0);
                    diagonal[keyframe] += weight * row.by_pose * row.by_pose.transpose();
                    diagonal[tag] += weight * by_tag * by_tag.transpose();
                    diagonal[calibration] += weight * by_calibration * by_calibration.transpose();
                    with_tags[number] += weight * by_tag * row.by_pose.transpose();
                    with_tags[tags] += weight * by_calibration * row.by_pose.transpose();
                    with_calibration[number] += weight * by_calibration * by_tag.transpose();
                    negative_gradient[keyframe] -= weight * row.residual * row.by_pose;
                    negative_gradient[tag] -= weight * row.residual * by_tag;
                    negative_gradient[calibration] -= weight * row.residual * by_calibration;
                }
            }
            let below = with_tags.into_iter().enumerate().filter(|(_, block)| *block != Matrix3::zeros());
            let below: Vec<_> = below.map(|(number, block)| (equations.tag(number), block)).collect();
            equations.columns[keyframe].extend(below);
        }
        for (number, block) in with_calibration.into_iter().enumerate() {
            let tag = equations.tag(number);
            equations.columns[tag].push((calibration, block));
        }
    }

    fn add_priors(&self, equations: &mut LandmarkEquations) {
        for (number, position) in self.tags.iter().enumerate() {
            let tag = equations.tag(number);
            // A position has two parts, and an unknown one none.
            match position {
                Some(_) => equations.diagonal[tag][(2, 2)] = 1.0,
                None => equations.diagonal[tag] = Matrix3::identity(),
            }
        }
        let calibration = equations.calibration();
        let prior = self.calibration_prior();
        equations.diagonal[calibration] += Matrix3::from_diagonal(&Vector3::new(prior.x, prior.y, 1.0));
        equations.negative_gradient[calibration] -=
            Vector3::new(prior.x * self.calibration.x, prior.y * self.calibration.y, 0.0);
        let systematic = equations.systematic();
        let prior = self.drift.systematic_information();
        equations.diagonal[systematic] += Matrix3::from_diagonal(&prior);
        equations.negative_gradient[systematic] -= prior.component_mul(&self.systematic);
    }

    /// Moves everything to the most probable estimate (Levenberg and Marquardt). Returns whether there is one.
    pub(super) fn optimize(&mut self) -> bool {
        let (mut damping, mut now) = (FIRST_DAMPING, self.cost());
        let mut equations = self.equations();
        for _ in 0..MAX_STEPS {
            let Some(step) = equations.solved(damping) else { return false };
            let (stepped, longest) = self.stepped(&step);
            let then = stepped.cost();
            if then.is_finite() && then <= now {
                let gain = now - then;
                *self = stepped;
                now = then;
                damping = (damping / DAMPING_FACTOR).max(FIRST_DAMPING);
                if longest < LEAST_STEP || gain < LEAST_GAIN {
                    break;
                }
                equations = self.equations();
            } else {
                damping *= DAMPING_FACTOR;
                if damping > MOST_DAMPING || longest < LEAST_STEP {
                    break;
                }
            }
        }
        now.is_finite()
    }

    /// The estimate after a step, and the longest part of the step.
    fn stepped(&self, step: &[Vector3<f64>]) -> (Self, f64) {
        let mut stepped = self.clone();
        let longest = step.iter().map(|step| step.amax()).fold(0.0, f64::max);
        let (of_poses, rest) = step.split_at(self.poses.len());
        for (pose, step) in stepped.poses.iter_mut().zip(of_poses).skip(1) {
            pose.translation.vector += step.xy();
            pose.rotation *= UnitComplex::new(step.z);
        }
        for (tag, step) in stepped.tags.iter_mut().zip(rest) {
            if let Some(tag) = tag {
                *tag += step.xy();
            }
        }
        if let [.., calibration, systematic] = rest {
            stepped.calibration += calibration.xy();
            stepped.systematic += systematic;
        }
        (stepped, longest)
    }

    /// Estimates the noise of each tag's readings from their residuals.
    pub(super) fn estimate_noise(&mut self) {
        let mut residuals = vec![[const { Vec::<f64>::new() }; Measured::KINDS]; self.tags.len()];
        for reading in self.readings() {
            if let Some(rows) = self.rows(reading, &Noise::CLAIMED) {
                let of_kind = &mut residuals[reading.tag][usize::from(reading.measured.kind())];
                of_kind.extend(rows.iter().map(|row| row.residual));
            }
        }
        for (noise, residuals) in self.noise.iter_mut().zip(residuals) {
            *noise = residuals.map(|residuals| Noise::of(&residuals));
        }
    }

    fn factor(&self) -> Option<BlockCholesky> {
        self.equations().factor(0.0)
    }

    /// Logarithm of the probability of all readings and steps under the assumed drift, whatever the poses and the tags
    /// (Laplace's approximation), but for a constant.
    pub(super) fn evidence(&self) -> Option<f64> {
        let determinant = self.factor()?.log_determinant();
        let information = |to| self.step_information(to).map_or(f64::NAN, |information| information.determinant().ln());
        let steps: f64 = (1..self.poses.len()).map(|to| 0.5 * information(to)).sum();
        let systematic: f64 = 0.5 * self.drift.systematic_information().map(f64::ln).sum();
        let readings = self.readings().iter().filter_map(|reading| {
            let noise = self.noise(reading);
            let rows = self.rows(reading, noise)?;
            Some(rows.count() as f64 * (rows.stddev * noise.factor).ln() / noise.correlated)
        });
        Some(steps + systematic - readings.sum::<f64>() - self.cost() - 0.5 * determinant)
            .filter(|evidence| evidence.is_finite())
    }

    /// Covariance of the located tags, x and y of each in their order.
    pub(super) fn covariance_of_tags(&self) -> Option<DMatrix<f64>> {
        let factored = self.factor()?;
        let inverse = factored.selected_inverse();
        let located: Vec<usize> = (0..self.tags.len()).filter(|&tag| self.tags[tag].is_some()).collect();
        let mut covariance = DMatrix::zeros(2 * located.len(), 2 * located.len());
        for (row, &a) in located.iter().enumerate() {
            for (column, &b) in located.iter().enumerate() {
                let block = inverse.at(self.poses.len() + a, self.poses.len() + b);
                let block: Matrix2<f64> = block.fixed_view::<2, 2>(0, 0).into_owned();
                covariance.fixed_view_mut::<2, 2>(2 * row, 2 * column).copy_from(&block);
            }
        }
        covariance.iter().all(|value| value.is_finite()).then_some(covariance)
    }
}

impl LandmarkEquations {
    /// Equations of nothing but the first keyframe, which is fixed.
    fn of_fixed_frame(poses: usize, tags: usize) -> Self {
        let count = poses + tags + 2;
        let mut diagonal = vec![Matrix3::zeros(); count];
        diagonal[0] = Matrix3::identity() * FIXED;
        Self {
            poses,
            tags,
            columns: vec![Vec::new(); count],
            diagonal,
            negative_gradient: vec![Vector3::zeros(); count],
        }
    }

    /// Places of the unknowns.
    fn tag(&self, number: usize) -> usize {
        self.poses + number
    }

    fn calibration(&self) -> usize {
        self.poses + self.tags
    }

    fn systematic(&self) -> usize {
        self.calibration() + 1
    }

    /// The factor with the diagonal larger by a share. `None` if it has none.
    fn factor(&self, damping: f64) -> Option<BlockCholesky> {
        let mut columns = self.columns.clone();
        for (place, (column, diagonal)) in columns.iter_mut().zip(&self.diagonal).enumerate() {
            let mut damped = *diagonal;
            for axis in 0..3 {
                damped[(axis, axis)] *= 1.0 + damping;
            }
            column.push((place, damped));
        }
        factor(&columns)
    }

    /// The step that they ask for, damped. `None` if they have no solution.
    fn solved(&self, damping: f64) -> Option<Vec<Vector3<f64>>> {
        let step = self.factor(damping)?.solve(&self.negative_gradient);
        step.iter().all(|step| step.iter().all(|value| value.is_finite())).then_some(step)
    }
}

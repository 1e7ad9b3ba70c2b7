//! One iteration of ICP: find correspondences, weigh them, solve for the change.

use super::initial_guess::LocalFrame;
use super::normal_equations::{Measurement, NormalEquations};
use super::{IcpParameters, InitialGuess, Metric, Weighting};
use crate::shared::geometry::{MovingLookup, Pose2, quarter_turn};
use crate::shared::walls::WallMap;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::FRAC_1_SQRT_2;

/// Least cosine between the normals of corresponding walls: 45 degrees.
const LEAST_NORMAL_AGREEMENT: f64 = FRAC_1_SQRT_2;

/// Least scale of the local coordinates, metres: the points of a tiny common section do not constrain the rotation.
const LEAST_SCALE: f64 = 0.1;

/// An iteration on two maps, with the memory that iterations share.
pub(super) struct Iteration<'a> {
    a: &'a WallMap,
    b: &'a WallMap,
    initial_guess: &'a InitialGuess,
    pub(super) parameters: &'a IcpParameters,
    measurements: Vec<Measurement>,
    /// For each point of b, the lookup of its nearest wall of a.
    lookups: Vec<MovingLookup>,
    state: IterationState,
}

/// Estimate of the last iteration, in its local coordinates.
pub(super) struct IterationState {
    pub(super) frame: LocalFrame,
    /// Information from the maps.
    pub(super) information: Matrix3<f64>,
    /// Covariance from the maps and the initial guess.
    pub(super) covariance: Matrix3<f64>,
    /// Number of corresponding points.
    pub(super) inliers: usize,
    /// Weighted mean of the squared residuals, square metres.
    pub(super) mean_square_error: f64,
}

/// The transform after an iteration, and the motion to it.
pub(super) struct Change {
    pub(super) transform_a_b: Pose2,
    /// In local coordinates, metres: its length is the root mean square motion of the points.
    pub(super) motion: Vector3<f64>,
}

impl<'a> Iteration<'a> {
    pub(super) fn new(
        a: &'a WallMap,
        b: &'a WallMap,
        initial_guess: &'a InitialGuess,
        parameters: &'a IcpParameters,
    ) -> Self {
        let frame = LocalFrame { centre: initial_guess.transform_a_b.translation.vector.into(), scale: 1.0 };
        let state = IterationState {
            frame,
            information: Matrix3::zeros(),
            covariance: initial_guess.local_covariance(&frame, parameters),
            inliers: 0,
            mean_square_error: 0.0,
        };
        let lookups = vec![MovingLookup::default(); b.walls.points().len()];
        Self { a, b, initial_guess, parameters, measurements: Vec::new(), lookups, state }
    }

    /// Estimate of the last iteration.
    pub(super) fn into_state(self) -> IterationState {
        self.state
    }

    /// Pairs every `stride`-th point of b with the nearest wall of a within `distance` metres, and computes the
    /// change that best fits these pairs and the initial guess. `None` if the change is not finite.
    pub(super) fn run(&mut self, transform_a_b: &Pose2, distance: f64, stride: usize) -> Option<Change> {
        self.solve(transform_a_b, distance, stride, self.parameters.metric)
    }

    /// Computes the information again by point-to-line residuals at the final transform, if it was found by
    /// point-to-point residuals. The point-to-point metric treats points that may move along their wall as fixed, so
    /// the position along a bare corridor would seem constrained.
    pub(super) fn measure_by_lines(&mut self, transform_a_b: &Pose2) {
        if self.parameters.metric == Metric::PointToPoint {
            self.solve(transform_a_b, self.parameters.min_distance, 1, Metric::PointToLine);
        }
    }

    fn solve(&mut self, transform_a_b: &Pose2, distance: f64, stride: usize, metric: Metric) -> Option<Change> {
        let (frame, inliers) = self.pair(transform_a_b, distance, stride, metric);
        let equations = NormalEquations::new(&self.measurements);
        let gain = self.gain(&equations, inliers, stride);
        let information = equations.information * gain;
        let prior = self.initial_guess.local_covariance(&frame, self.parameters).try_inverse()?;
        let covariance = (information + prior).try_inverse()?;
        let deviation = self.initial_guess.local_deviation(transform_a_b, &frame);
        let change = covariance * (equations.vector * gain - prior * deviation);
        if !change.iter().chain(covariance.iter()).all(|value| value.is_finite()) {
            return None;
        }
        let mean_square_error = equations.mean_square_error;
        self.state = IterationState { frame, information, covariance, inliers, mean_square_error };
        Some(Change { transform_a_b: frame.moved(transform_a_b, &change), motion: change })
    }

    /// Root of the weighted mean of the squared residuals of the last iteration, before its step, metres.
    pub(super) fn error(&self) -> f64 {
        self.state.mean_square_error.sqrt()
    }

    /// Centroid and size of the section in which the walls of the two maps are near each other.
    pub(super) fn common_section(&mut self, transform_a_b: &Pose2, stride: usize) -> LocalFrame {
        self.pair(transform_a_b, self.parameters.max_distance, stride, self.parameters.metric).0
    }

    /// Sum of the weights of the points that have a wall within the least distance.
    pub(super) fn matched(&mut self, transform_a_b: &Pose2, stride: usize) -> f64 {
        self.pair(transform_a_b, self.parameters.min_distance, stride, self.parameters.metric);
        self.measurements.iter().map(|measurement| measurement.weight).sum()
    }

    /// Factor from the information of measurements of variance one to the information: neighbouring cells have
    /// correlated errors, and no wall is known better than the cell size.
    fn gain(&self, equations: &NormalEquations, inliers: usize, stride: usize) -> f64 {
        if inliers == 0 {
            return 0.0;
        }
        let points = inliers as f64;
        let independent = (points * stride as f64 * self.b.spacing / self.parameters.correlation_length).min(points);
        let drawn = (self.a.spacing.powi(2) + self.b.spacing.powi(2)) / 12.0;
        independent / points / equations.mean_square_error.max(drawn)
    }

    /// Stores the residual of each pair of points. Returns the local coordinates of the residuals and the number of
    /// pairs.
    fn pair(&mut self, transform_a_b: &Pose2, distance: f64, stride: usize, metric: Metric) -> (LocalFrame, usize) {
        let (a, b) = (self.a, self.b);
        self.measurements.clear();
        let mut inliers = 0;
        let (mut sum, mut squares) = (Vector2::zeros(), 0.0);
        let origin = transform_a_b.translation.vector;
        let usual = distance / 3.0;
        let points_b = b.walls.points().iter().zip(&b.normals).zip(&mut self.lookups);
        let mut before = usize::MAX;
        for ((point_b, normal_b), lookup) in points_b.step_by(stride) {
            let point = transform_a_b * point_b;
            let Some(partner) = lookup.nearest(&a.walls, &point, distance, before) else { continue };
            before = partner.index;
            let offset = point - a.walls.points()[partner.index];
            let normal = a.normals[partner.index];
            let arm = point.coords - origin;
            // Turns about the origin of b; moved to the centroid of all pairs once that is known.
            let turned = quarter_turn(&arm);
            match metric {
                Metric::PointToLine => {
                    if normal.dot(&(transform_a_b.rotation * normal_b)).abs() < LEAST_NORMAL_AGREEMENT {
                        continue;
                    }
                    let residual = normal.dot(&offset);
                    let weight = self.parameters.weighting.weight(residual, usual);
                    let derivative = normal.push(normal.dot(&turned));
                    self.measurements.push(Measurement { derivative, residual, weight });
                }
                Metric::PointToPoint => {
                    let weight = self.parameters.weighting.weight(offset.norm(), usual);
                    let x = Vector3::new(1.0, 0.0, turned.x);
                    let y = Vector3::new(0.0, 1.0, turned.y);
                    self.measurements.push(Measurement { derivative: x, residual: offset.x, weight });
                    self.measurements.push(Measurement { derivative: y, residual: offset.y, weight });
                }
            }
            inliers += 1;
            sum += arm;
            squares += arm.norm_squared();
        }
        let count = f64::max(inliers as f64, 1.0);
        let mean = sum / count;
        let scale = (squares / count - mean.norm_squared()).max(0.0).sqrt().max(LEAST_SCALE);
        let turned = quarter_turn(&mean);
        for Measurement { derivative, .. } in &mut self.measurements {
            derivative.z = (derivative.z - derivative.xy().dot(&turned)) / scale;
        }
        (LocalFrame { centre: (origin + mean).into(), scale }, inliers)
    }
}

impl Weighting {
    /// Weight of a pair at `distance`, where `usual` is the usual distance, metres.
    fn weight(self, distance: f64, usual: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Huber => (usual / distance.abs().max(f64::MIN_POSITIVE)).min(1.0),
            Self::GemanMcclure => {
                let square = usual * usual;
                let ratio = square / (square + distance * distance);
                ratio * ratio
            }
        }
    }
}

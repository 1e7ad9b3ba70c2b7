//! The least squares problem of one iteration.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// A measurement says nothing about a direction that its normal stands across by less than 12 degrees: so much do the
/// normals of walls that are drawn in cells scatter. Without this bound the thousand cells of a straight corridor would,
/// by their noise alone, seem to fix the place along it. (The idea is that of X-ICP, Tuna et al. 2023.)
const LEAST_SINE: f64 = 0.2;

/// One linear measurement of the change that is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement {
    /// Derivative of the residual by the local coordinates.
    pub(super) derivative: Vector3<f64>,
    /// How far the point is from where it should be, metres.
    pub(super) residual: f64,
    /// Its weight, 0 to 1.
    pub(super) weight: f64,
}

/// What all measurements say together.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalEquations {
    /// Information about the local coordinates, for measurements of variance one.
    pub(super) information: Matrix3<f64>,
    /// Its right-hand side: information times the change that is looked for.
    pub(super) vector: Vector3<f64>,
    /// Weighted mean of the squared residuals, square metres.
    pub(super) mean_square_error: f64,
}

impl NormalEquations {
    /// Sums the measurements up, in their order. In each of the three main directions count those that can see it.
    pub(super) fn new(measurements: &[Measurement]) -> Self {
        let mut information = Matrix3::zeros();
        let (mut weight, mut squares) = (0.0, 0.0);
        for measurement in measurements {
            information += measurement.derivative * measurement.derivative.transpose() * measurement.weight;
            weight += measurement.weight;
            squares += measurement.weight * measurement.residual * measurement.residual;
        }
        let axes = SymmetricEigen::new(information).eigenvectors;
        let (mut seen, mut pulled) = (Vector3::zeros(), Vector3::zeros());
        for measurement in measurements {
            let along = axes.tr_mul(&measurement.derivative);
            for axis in 0..3 {
                if along[axis].abs() > LEAST_SINE {
                    seen[axis] += measurement.weight * along[axis] * along[axis];
                    pulled[axis] -= measurement.weight * along[axis] * measurement.residual;
                }
            }
        }
        Self {
            information: axes * Matrix3::from_diagonal(&seen) * axes.transpose(),
            vector: axes * pulled,
            mean_square_error: if weight > 0.0 { squares / weight } else { 0.0 },
        }
    }
}

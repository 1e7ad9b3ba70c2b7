//! The least squares problem of one iteration.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Least sine of the angle between a wall and a direction that it constrains, 12 degrees: the normals of walls drawn
/// in cells scatter by as much. Without this bound the thousand cells of a straight corridor would seem to constrain
/// the position along it, by noise alone. (The idea is that of X-ICP, Tuna et al. 2023.)
const LEAST_SINE: f64 = 0.2;

/// More Jacobi sweeps than the axes of a 3 x 3 matrix ever take.
const MOST_SWEEPS: usize = 100;

/// One linear measurement of the change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement {
    /// Derivative of the residual with respect to the local coordinates.
    pub(super) derivative: Vector3<f64>,
    /// Signed distance of the point from its wall, metres.
    pub(super) residual: f64,
    /// Its weight, 0 to 1.
    pub(super) weight: f64,
}

/// Sum of all measurements.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalEquations {
    /// Information on the local coordinates, for measurements of variance one.
    pub(super) information: Matrix3<f64>,
    /// Right-hand side: information times the change.
    pub(super) vector: Vector3<f64>,
    /// Weighted mean of the squared residuals, square metres.
    pub(super) mean_square_error: f64,
}

impl NormalEquations {
    /// Sums the measurements, in their order. For each of the three principal directions only those count that
    /// constrain it.
    pub(super) fn new(measurements: &[Measurement]) -> Self {
        let mut information = Matrix3::zeros();
        let (mut weight, mut squares) = (0.0, 0.0);
        for measurement in measurements {
            information += measurement.derivative * measurement.derivative.transpose() * measurement.weight;
            weight += measurement.weight;
            squares += measurement.weight * measurement.residual * measurement.residual;
        }
        // Values that overflow have no axes; the solution is then refused as not finite.
        let axes = SymmetricEigen::try_new(information, f64::EPSILON, MOST_SWEEPS)
            .map_or_else(Matrix3::identity, |eigen| eigen.eigenvectors);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn measurement(x: f64, y: f64, turn: f64, residual: f64) -> Measurement {
        Measurement { derivative: Vector3::new(x, y, turn), residual, weight: 1.0 }
    }

    #[test]
    fn normals_that_scatter_by_a_few_degrees_do_not_constrain_a_corridor() {
        let corridor: Vec<Measurement> = (0..1000)
            .map(|i| {
                let tilt = 0.1 * f64::from(i).sin();
                measurement(tilt.sin(), tilt.cos(), f64::from(i % 21 - 10) / 10.0, 0.01)
            })
            .collect();
        let equations = NormalEquations::new(&corridor);
        let across = equations.information.m22;
        assert!(across > 900.0);
        assert!(equations.information.m11 < 1e-3 * across, "{}", equations.information);
        assert!((equations.mean_square_error - 1e-4).abs() < 1e-12);
    }

    #[test]
    fn a_wall_across_the_corridor_constrains_the_position_along_it() {
        let mut walls = vec![measurement(0.0, 1.0, 0.5, 0.0); 100];
        walls.extend([measurement(0.0, 1.0, -0.5, 0.0); 100]);
        walls.extend([measurement(1.0, 0.0, 0.0, 0.2); 10]);
        let equations = NormalEquations::new(&walls);
        assert!((equations.information.m11 - 10.0).abs() < 1e-9);
        assert!((equations.vector - Vector3::new(-2.0, 0.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn without_measurements_nothing_is_known() {
        let equations = NormalEquations::new(&[]);
        assert_eq!(equations.information, Matrix3::zeros());
        assert_eq!(equations.mean_square_error, 0.0);
    }
}

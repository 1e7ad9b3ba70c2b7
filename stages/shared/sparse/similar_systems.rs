//! Solution of systems whose matrices differ little from one to the next, as in the steps of Gauss and Newton.

use super::{BlockCholesky, Columns, factor};
use nalgebra::Vector3;

/// Most steps of conjugate gradients, each of which takes two products and a fraction of the time of a factorization.
const MAX_STEPS: usize = 24;
/// Error that is left, as a share of the solution, both in the norm that the factor gives.
const TOLERANCE: f64 = 1e-6;

/// A factor of one of the matrices, with which the systems of others are solved: by the method of conjugate gradients,
/// preconditioned with the factor (Golub and Van Loan, "Matrix Computations", section 11.5). Where that takes too many
/// steps the matrix at hand is factored in its place.
#[derive(Debug, Default)]
pub(crate) struct SimilarSystems {
    factor: Option<BlockCholesky>,
}

impl SimilarSystems {
    /// Solves a system. `None` if its matrix is not positive definite.
    pub(crate) fn solve(&mut self, matrix: &Columns, right: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let known = self.factor.as_ref().filter(|factor| factor.len() == right.len());
        if let Some(solution) = known.and_then(|factor| conjugate_gradients(matrix, right, factor)) {
            return Some(solution);
        }
        // Memory of the old factor is free before the other needs its own.
        self.factor = None;
        Some(self.factor.insert(factor(matrix)?).solve(right))
    }
}

/// Solves a system by the method of conjugate gradients. `None` if it has not converged in time, as where a value is not
/// a number.
fn conjugate_gradients(
    matrix: &Columns,
    right: &[Vector3<f64>],
    preconditioner: &BlockCholesky,
) -> Option<Vec<Vector3<f64>>> {
    let mut solution = vec![Vector3::zeros(); right.len()];
    let mut residual = right.to_vec();
    let mut along = preconditioner.solve(&residual);
    let mut error = dot(&residual, &along);
    let wanted = TOLERANCE * TOLERANCE * error;
    for _ in 0..MAX_STEPS {
        if error <= wanted {
            return Some(solution);
        }
        let product = product(matrix, &along);
        let step = error / dot(&along, &product);
        add(&mut solution, step, &along);
        add(&mut residual, -step, &product);
        let preconditioned = preconditioner.solve(&residual);
        let before = std::mem::replace(&mut error, dot(&residual, &preconditioned));
        let share = error / before;
        along.iter_mut().zip(&preconditioned).for_each(|(along, by)| *along = by + share * *along);
    }
    None
}

/// Product of a matrix, of which the lower triangle is given, and a vector.
fn product(matrix: &Columns, vector: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut product = vec![Vector3::zeros(); vector.len()];
    for (column, entries) in matrix.iter().enumerate() {
        for (row, block) in entries {
            product[*row] += block * vector[column];
            if *row != column {
                product[column] += block.tr_mul(&vector[*row]);
            }
        }
    }
    product
}

fn dot(one: &[Vector3<f64>], other: &[Vector3<f64>]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one.dot(other)).sum()
}

fn add(to: &mut [Vector3<f64>], times: f64, other: &[Vector3<f64>]) {
    to.iter_mut().zip(other).for_each(|(to, other)| *to += times * other);
}

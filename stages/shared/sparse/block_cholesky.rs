//! Cholesky factor of a sparse symmetric matrix of blocks of 3 x 3.

use super::assembly_tree::AssemblyTree;
use super::block_column::BlockColumn;
use nalgebra::{Matrix3, Vector3};

/// Lower factor `L` of a matrix `L L^T`.
#[derive(Clone, Debug)]
pub(crate) struct BlockCholesky {
    pub(super) tree: AssemblyTree,
    /// In the order of the tree's.
    pub(super) fronts: Vec<FactoredFront>,
}

/// Columns of a factor that are dense together.
#[derive(Clone, Debug, Default)]
pub(super) struct FactoredFront {
    /// Each from its diagonal block on.
    pub(super) columns: Vec<BlockColumn>,
    /// Inverse of each diagonal block.
    pub(super) inverses: Vec<Matrix3<f64>>,
}

impl BlockCholesky {
    /// Logarithm of the determinant of the matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        let columns = self.fronts.iter().flat_map(|front| &front.columns);
        columns.map(|column| 2.0 * column.block(0).diagonal().map(f64::ln).sum()).sum()
    }

    /// Solves the system with the right-hand side `right`.
    pub(crate) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut solution = right.to_vec();
        for (front, factored) in self.tree.fronts.iter().zip(&self.fronts) {
            for (place, (column, inverse)) in factored.columns.iter().zip(&factored.inverses).enumerate() {
                let solved = inverse * solution[front.row(place)];
                solution[front.row(place)] = solved;
                for below in 1..column.len() {
                    solution[front.row(place + below)] -= column.block(below) * solved;
                }
            }
        }
        for (front, factored) in self.tree.fronts.iter().zip(&self.fronts).rev() {
            for (place, (column, inverse)) in factored.columns.iter().zip(&factored.inverses).enumerate().rev() {
                let of_rows = (1..column.len()).fold(Vector3::zeros(), |sum, below| {
                    sum + column.block(below).tr_mul(&solution[front.row(place + below)])
                });
                let own = &mut solution[front.row(place)];
                *own = inverse.tr_mul(&(*own - of_rows));
            }
        }
        solution
    }
}

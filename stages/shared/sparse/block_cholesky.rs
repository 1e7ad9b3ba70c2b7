//! Cholesky factor of a sparse symmetric matrix of blocks of 3 x 3.

use super::assembly_tree::{AssemblyTree, Front};
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
    /// Number of blocks of a column.
    pub(super) fn len(&self) -> usize {
        self.tree.front_of.len()
    }

    /// Logarithm of the determinant of the matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        let columns = self.fronts.iter().flat_map(|front| &front.columns);
        columns.map(|column| 2.0 * column.block(0).diagonal().map(f64::ln).sum()).sum()
    }

    /// Solves the system with the right-hand side `right`.
    pub(crate) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut solution = right.to_vec();
        // The rows of one front, contiguous.
        let mut dense: Vec<f64> = Vec::new();
        for (front, factored) in self.tree.fronts.iter().zip(&self.fronts) {
            gather(&mut dense, front, &solution);
            for (place, (column, inverse)) in factored.columns.iter().zip(&factored.inverses).enumerate() {
                let (own, below) = dense[3 * place..].split_at_mut(3);
                let solved = inverse * Vector3::from_column_slice(own);
                own.copy_from_slice(solved.as_slice());
                column.subtract_below(&solved, below);
            }
            scatter(&dense, front, front.size(), &mut solution);
        }
        for (front, factored) in self.tree.fronts.iter().zip(&self.fronts).rev() {
            gather(&mut dense, front, &solution);
            for (place, (column, inverse)) in factored.columns.iter().zip(&factored.inverses).enumerate().rev() {
                let (own, below) = dense[3 * place..].split_at_mut(3);
                let solved = inverse.tr_mul(&(Vector3::from_column_slice(own) - column.product_below(below)));
                own.copy_from_slice(solved.as_slice());
            }
            scatter(&dense, front, front.own(), &mut solution);
        }
        solution
    }
}

/// Copies the rows of a front.
fn gather(dense: &mut Vec<f64>, front: &Front, all: &[Vector3<f64>]) {
    dense.clear();
    (0..front.size()).for_each(|place| dense.extend_from_slice(all[front.row(place)].as_slice()));
}

/// Copies the first rows of a front back.
fn scatter(dense: &[f64], front: &Front, count: usize, all: &mut [Vector3<f64>]) {
    let rows = dense.chunks_exact(3).take(count).enumerate();
    rows.for_each(|(place, row)| all[front.row(place)].copy_from_slice(row));
}

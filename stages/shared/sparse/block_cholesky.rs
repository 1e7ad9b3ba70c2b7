//! Cholesky factor of a sparse symmetric matrix of blocks of 3 x 3, and the parts of its inverse that are needed.
//! Blocks of a fixed size need one index for nine numbers, and the processor keeps them in registers.

use nalgebra::{Matrix3, Vector3};

/// Lower factor `L` of a matrix `L L^T`.
#[derive(Clone, Debug)]
pub(crate) struct BlockCholesky {
    /// Start of each column in `blocks`.
    pub(crate) starts: Vec<usize>,
    /// Row of each block: in each column the diagonal comes first, and then those below.
    pub(crate) rows: Vec<usize>,
    pub(crate) blocks: Vec<Matrix3<f64>>,
    /// Inverse of each diagonal block.
    pub(crate) inverses: Vec<Matrix3<f64>>,
}

impl BlockCholesky {
    /// The blocks of a column below its diagonal, each with its row.
    fn below(&self, column: usize) -> impl Iterator<Item = (usize, &Matrix3<f64>)> {
        let places = self.starts[column] + 1..self.starts[column + 1];
        self.rows[places.clone()].iter().copied().zip(&self.blocks[places])
    }

    /// Logarithm of the determinant of the matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        let diagonals = self.starts.iter().take(self.inverses.len()).map(|&own| self.blocks[own].diagonal());
        diagonals.map(|diagonal| 2.0 * diagonal.map(f64::ln).sum()).sum()
    }

    /// Solves the system with the right-hand side `right`.
    pub(crate) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut solution = right.to_vec();
        for column in 0..solution.len() {
            solution[column] = self.inverses[column] * solution[column];
            for (row, block) in self.below(column) {
                let part = block * solution[column];
                solution[row] -= part;
            }
        }
        for column in (0..solution.len()).rev() {
            let of_rows =
                self.below(column).fold(Vector3::zeros(), |sum, (row, block)| sum + block.tr_mul(&solution[row]));
            solution[column] = self.inverses[column].tr_mul(&(solution[column] - of_rows));
        }
        solution
    }

    /// Computes the blocks of the inverse at which the factor has any, by the recursion of Takahashi, Fagan and Chen
    /// (1973). It takes about as long as the factorization; the whole inverse, which is dense, would take one
    /// solution for each row.
    pub(crate) fn selected_inverse(&self) -> SelectedInverse<'_> {
        let mut values = vec![Matrix3::zeros(); self.blocks.len()];
        // Sums of one column, as the recursion needs them: one for each row below the diagonal.
        let mut sums: Vec<Matrix3<f64>> = Vec::new();
        for column in (0..self.inverses.len()).rev() {
            let (own, end) = (self.starts[column], self.starts[column + 1]);
            let below = &self.rows[own + 1..end];
            let blocks = &self.blocks[own + 1..end];
            sums.clear();
            sums.resize(below.len(), Matrix3::zeros());
            for (k, &row_k) in below.iter().enumerate() {
                // Column k holds every later row of this column, by the fill-in of a factor.
                let mut place = self.starts[row_k];
                for i in k..below.len() {
                    while self.rows[place] < below[i] {
                        place += 1;
                    }
                    sums[i] += values[place] * blocks[k];
                    if i != k {
                        sums[k] += values[place].tr_mul(&blocks[i]);
                    }
                }
            }
            let inverse = &self.inverses[column];
            let mut left = inverse.transpose();
            for (i, sum) in sums.iter().enumerate() {
                let value = -sum * inverse;
                values[own + 1 + i] = value;
                left -= value.tr_mul(&blocks[i]);
            }
            values[own] = left * inverse;
        }
        SelectedInverse { factor: self, values }
    }
}

/// Blocks of the inverse of a matrix at which its factor has any.
#[derive(Clone, Debug)]
pub(crate) struct SelectedInverse<'a> {
    factor: &'a BlockCholesky,
    /// In the order of the factor's blocks.
    values: Vec<Matrix3<f64>>,
}

impl SelectedInverse<'_> {
    /// A block of the inverse; zeros where the factor has none.
    pub(crate) fn at(&self, row: usize, column: usize) -> Matrix3<f64> {
        let (low, high) = (row.max(column), row.min(column));
        let (start, end) = (self.factor.starts[high], self.factor.starts[high + 1]);
        let place = self.factor.rows[start..end].binary_search(&low);
        let block = place.map_or_else(|_| Matrix3::zeros(), |place| self.values[start + place]);
        if row >= column { block } else { block.transpose() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dissection::Part;
    use super::super::factoring::{Columns, factor};
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    const BLOCKS: usize = 7;

    /// A matrix of blocks with holes, and the same as a dense one.
    fn matrix(seed: &[f64], holes: usize) -> (Columns, DMatrix<f64>) {
        let sparse = DMatrix::from_fn(3 * BLOCKS, 3 * BLOCKS, |row, column| {
            let is_there = (row / 3 * 7 + column / 3 * 5 + holes).is_multiple_of(4);
            if is_there { seed[row * 3 * BLOCKS + column] } else { 0.0 }
        });
        let matrix = &sparse * sparse.transpose() + DMatrix::identity(3 * BLOCKS, 3 * BLOCKS);
        let block = |row: usize, column: usize| matrix.fixed_view::<3, 3>(3 * row, 3 * column).into_owned();
        // Each block in two parts.
        let entries = |column: usize| {
            let rows = (column..BLOCKS).rev().filter(move |&row| block(row, column) != Matrix3::zeros());
            rows.flat_map(move |row| [(row, 0.25 * block(row, column)), (row, 0.75 * block(row, column))])
        };
        ((0..BLOCKS).map(|column| entries(column).collect()).collect(), matrix)
    }

    proptest! {
        #[test]
        fn the_solution_and_the_determinant_and_the_blocks_of_the_inverse_are_those_of_the_dense_matrix(
            seed in prop::collection::vec(-1.0..1.0f64, 9 * BLOCKS * BLOCKS),
            holes in 0..100_usize,
        ) {
            let (columns, dense) = matrix(&seed, holes);
            let factor = factor(&columns, &Part::undivided(0..BLOCKS)).unwrap();
            let inverse = dense.clone().try_inverse().unwrap();
            prop_assert!((factor.log_determinant() - dense.determinant().ln()).abs() < 1e-9);
            let right = DVector::from_fn(3 * BLOCKS, |row, _| seed[row]);
            let expected = &inverse * &right;
            let blocks: Vec<Vector3<f64>> =
                (0..BLOCKS).map(|row| right.fixed_rows::<3>(3 * row).into_owned()).collect();
            for (row, found) in factor.solve(&blocks).iter().enumerate() {
                prop_assert!((found - expected.fixed_rows::<3>(3 * row)).norm() < 1e-9);
            }
            let selected = factor.selected_inverse();
            for column in 0..BLOCKS {
                for &row in &factor.rows[factor.starts[column]..factor.starts[column + 1]] {
                    let expected = inverse.fixed_view::<3, 3>(3 * row, 3 * column).into_owned();
                    prop_assert!((selected.at(row, column) - expected).norm() < 1e-9);
                    prop_assert!((selected.at(column, row) - expected.transpose()).norm() < 1e-9);
                }
            }
        }
    }
}

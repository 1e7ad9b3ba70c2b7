//! The part of the inverse of a sparse matrix that is needed for covariances, without the rest of it.

use nalgebra_sparse::CscMatrix;

/// The entries of `(L L^T)^-1` where the factor `L` has any, by the recursion of Takahashi, Fagan and Chen (1973). It takes
/// about as long as the factor did, where the whole inverse, which is dense, would take as many solutions as there are rows.
pub(super) struct SelectedInverse<'a> {
    factor: &'a CscMatrix<f64>,
    /// In the order of the factor's entries.
    values: Vec<f64>,
}

impl<'a> SelectedInverse<'a> {
    /// Of the lower factor of a Cholesky factorization: in each column the diagonal entry comes first.
    pub(super) fn of(factor: &'a CscMatrix<f64>) -> Self {
        let (starts, rows, entries) = (factor.col_offsets(), factor.row_indices(), factor.values());
        let mut values = vec![0.0; entries.len()];
        // One column of sums, as the recursion needs it: for each row of column j below the diagonal.
        let mut sums = Vec::new();
        for column in (0..factor.ncols()).rev() {
            let (start, end) = (starts[column], starts[column + 1]);
            let (diagonal, below) = (entries[start], &rows[start + 1..end]);
            sums.clear();
            sums.resize(below.len(), 0.0);
            for (k, &row_k) in below.iter().enumerate() {
                let of_k = entries[start + 1 + k];
                // Column k holds every later row of this column: that is how a factor fills in.
                let mut place = starts[row_k];
                for (i, &row_i) in below.iter().enumerate().skip(k) {
                    while rows[place] < row_i {
                        place += 1;
                    }
                    sums[i] += values[place] * of_k;
                    if i != k {
                        sums[k] += values[place] * entries[start + 1 + i];
                    }
                }
            }
            let mut own = 1.0 / diagonal;
            for (i, sum) in sums.iter().enumerate() {
                let value = -sum / diagonal;
                values[start + 1 + i] = value;
                own -= value * entries[start + 1 + i];
            }
            values[start] = own / diagonal;
        }
        Self { factor, values }
    }

    /// An entry of the inverse; 0 where the factor has none.
    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        let (row, column) = (row.max(column), row.min(column));
        let (start, end) = (self.factor.col_offsets()[column], self.factor.col_offsets()[column + 1]);
        let place = self.factor.row_indices()[start..end].binary_search(&row);
        place.map_or(0.0, |place| self.values[start + place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use nalgebra_sparse::factorization::CscCholesky;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn its_entries_are_those_of_the_inverse(seed in prop::collection::vec(-1.0..1.0f64, 12 * 12), holes in 0..100_usize) {
            let sparse = DMatrix::from_fn(12, 12, |row, column| {
                let is_there = (row * 7 + column * 5 + holes) % 4 == 0;
                if is_there { seed[row * 12 + column] } else { 0.0 }
            });
            let matrix = &sparse * sparse.transpose() + DMatrix::identity(12, 12);
            let factorization = CscCholesky::factor(&CscMatrix::from(&matrix)).unwrap();
            let selected = SelectedInverse::of(factorization.l());
            let inverse = matrix.try_inverse().unwrap();
            for (row, column, _) in factorization.l().triplet_iter() {
                prop_assert!((selected.at(row, column) - inverse[(row, column)]).abs() < 1e-9);
                prop_assert_eq!(selected.at(row, column), selected.at(column, row));
            }
        }
    }
}

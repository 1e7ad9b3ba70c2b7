//! The Cholesky factor of a sparse symmetric matrix of blocks of 3 x 3, and what is needed of its inverse.
//!
//! The factor is made column by column, each from those before it that reach it (left-looking; Davis, "Direct Methods for
//! Sparse Linear Systems", 2006). Blocks of a fixed size take an index for nine numbers, and the processor keeps them in registers.

use super::dissection::Part;
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// The lower triangle of a symmetric matrix by its columns: the entries of each in any order, and several for one place, which are
/// added up.
pub(super) type Columns = Vec<Vec<(usize, Matrix3<f64>)>>;

/// No column.
const NONE: usize = usize::MAX;
/// Parts of fewer columns are made in one go.
const LEAST_DIVIDED: usize = 200;

/// The lower factor `L` of a matrix `L L^T`.
#[derive(Clone, Debug)]
pub(super) struct BlockCholesky {
    /// Where the blocks of each column begin.
    starts: Vec<usize>,
    /// The row of each block: in each column the diagonal comes first, and then those below.
    rows: Vec<usize>,
    blocks: Vec<Matrix3<f64>>,
    /// The inverse of each diagonal block.
    inverses: Vec<Matrix3<f64>>,
}

impl BlockCholesky {
    /// Factors a matrix, whose columns are in an order of which `whole` tells what has nothing to do with each other. `None` if it
    /// is not positive definite.
    pub(super) fn factor(columns: &Columns, whole: &Part) -> Option<Self> {
        let (starts, rows) = pattern(columns);
        let mut blocks = vec![Matrix3::zeros(); rows.len()];
        let mut inverses = vec![Matrix3::zeros(); columns.len()];
        let mut next = starts[..columns.len()].to_vec();
        let made = MadeColumns { blocks: &mut blocks, inverses: &mut inverses, next: &mut next };
        Factoring { columns, starts: &starts, rows: &rows }.factor(whole, made)?;
        Some(Self { starts, rows, blocks, inverses })
    }

    /// The blocks of a column below its diagonal, each with its row.
    fn below(&self, column: usize) -> impl Iterator<Item = (usize, &Matrix3<f64>)> {
        let places = self.starts[column] + 1..self.starts[column + 1];
        self.rows[places.clone()].iter().copied().zip(&self.blocks[places])
    }

    /// The logarithm of the matrix's determinant.
    pub(super) fn log_determinant(&self) -> f64 {
        let diagonals = self.starts.iter().take(self.inverses.len()).map(|&own| self.blocks[own].diagonal());
        diagonals.map(|diagonal| 2.0 * diagonal.map(f64::ln).sum()).sum()
    }

    /// What the matrix takes to `right`.
    pub(super) fn solve(&self, right: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
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

    /// The blocks of the inverse where the factor has any, by the recursion of Takahashi, Fagan and Chen (1973). It takes
    /// about as long as the factor did, where the whole inverse, which is dense, would take as many solutions as there are rows.
    pub(super) fn selected_inverse(&self) -> SelectedInverse<'_> {
        let mut values = vec![Matrix3::zeros(); self.blocks.len()];
        // One column of sums, as the recursion needs it: for each row below the diagonal.
        let mut sums: Vec<Matrix3<f64>> = Vec::new();
        for column in (0..self.inverses.len()).rev() {
            let (own, end) = (self.starts[column], self.starts[column + 1]);
            let below = &self.rows[own + 1..end];
            let blocks = &self.blocks[own + 1..end];
            sums.clear();
            sums.resize(below.len(), Matrix3::zeros());
            for (k, &row_k) in below.iter().enumerate() {
                // Column k holds every later row of this column: that is how a factor fills in.
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

/// A matrix that is being factored, and where its factor has blocks.
struct Factoring<'a> {
    columns: &'a Columns,
    starts: &'a [usize],
    rows: &'a [usize],
}

/// The columns of the factor that belong to a part.
struct MadeColumns<'a> {
    blocks: &'a mut [Matrix3<f64>],
    inverses: &'a mut [Matrix3<f64>],
    /// For each column that is made, its first block that lies in no row of a column that is made.
    next: &'a mut [usize],
}

impl<'a> MadeColumns<'a> {
    /// The first so many columns, which have so many blocks, and the others.
    fn split(self, columns: usize, blocks: usize) -> [MadeColumns<'a>; 2] {
        let (first_blocks, blocks) = self.blocks.split_at_mut(blocks);
        let (first_inverses, inverses) = self.inverses.split_at_mut(columns);
        let (first_next, next) = self.next.split_at_mut(columns);
        [
            MadeColumns { blocks: first_blocks, inverses: first_inverses, next: first_next },
            MadeColumns { blocks, inverses, next },
        ]
    }

    fn borrowed(&mut self) -> MadeColumns<'_> {
        MadeColumns { blocks: self.blocks, inverses: self.inverses, next: self.next }
    }
}

impl Factoring<'_> {
    /// Makes the columns of a part: those of its sides at once, as none reaches a column of the other side, and then those that
    /// separate them. In which order parts are added up does not depend on which side is done first.
    fn factor(&self, part: &Part, mut made: MadeColumns<'_>) -> Option<()> {
        let mut own = part.places.clone();
        if let Some(sides) = part.sides.as_deref().filter(|_| own.len() > LEAST_DIVIDED) {
            let [low, high] = sides;
            let blocks_of = |side: &Part| self.starts[side.places.end] - self.starts[side.places.start];
            let [of_low, others] = made.borrowed().split(low.places.len(), blocks_of(low));
            let [of_high, _] = others.split(high.places.len(), blocks_of(high));
            let (low_made, high_made) = rayon::join(|| self.factor(low, of_low), || self.factor(high, of_high));
            low_made.and(high_made)?;
            own.start = high.places.end;
        }
        self.factor_own(part.places.start, own, made)
    }

    /// Makes the columns `own` of a part that begins with the column `first`. Those before them are made.
    fn factor_own(&self, first: usize, own: Range<usize>, made: MadeColumns<'_>) -> Option<()> {
        let MadeColumns { blocks, inverses, next } = made;
        let begin = self.starts[first];
        // For each own column those before it whose next block lies in its row.
        let mut reaching: Vec<Vec<usize>> = vec![Vec::new(); own.len()];
        let reach = |reaching: &mut Vec<Vec<usize>>, column: usize, next: usize| {
            if next < self.starts[column + 1] && own.contains(&self.rows[next]) {
                reaching[self.rows[next] - own.start].push(column);
            }
        };
        (first..own.start).for_each(|column| reach(&mut reaching, column, next[column - first]));
        // By row, from the first own one.
        let mut work = vec![Matrix3::zeros(); self.columns.len() - own.start];
        for column in own.clone() {
            for (row, block) in &self.columns[column] {
                work[*row - own.start] += block;
            }
            for before in std::mem::take(&mut reaching[column - own.start]) {
                let places = next[before - first]..self.starts[before + 1];
                let of_before = &blocks[places.start - begin..places.end - begin];
                let by = of_before[0].transpose();
                for (row, block) in self.rows[places].iter().zip(of_before) {
                    work[*row - own.start] -= block * by;
                }
                next[before - first] += 1;
                reach(&mut reaching, before, next[before - first]);
            }
            let places = self.starts[column]..self.starts[column + 1];
            let diagonal = work[column - own.start].cholesky()?.l();
            let inverse = diagonal.try_inverse()?;
            blocks[places.start - begin] = diagonal;
            work[column - own.start] = Matrix3::zeros();
            let by = inverse.transpose();
            for place in places.start + 1..places.end {
                let work = &mut work[self.rows[place] - own.start];
                blocks[place - begin] = *work * by;
                *work = Matrix3::zeros();
            }
            inverses[column - first] = inverse;
            next[column - first] = places.start + 1;
            reach(&mut reaching, column, places.start + 1);
        }
        Some(())
    }
}

/// Where the columns of the factor begin, and the rows of their blocks: a column has those of the matrix, and those of the columns
/// whose first block below the diagonal lies in its row (Liu 1990, "The role of elimination trees in sparse factorization").
fn pattern(columns: &Columns) -> (Vec<usize>, Vec<usize>) {
    let mut starts = vec![0];
    let mut rows: Vec<usize> = Vec::new();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); columns.len()];
    let mut seen_in = vec![NONE; columns.len()];
    let mut of_column = Vec::new();
    for (column, entries) in columns.iter().enumerate() {
        of_column.clear();
        seen_in[column] = column;
        let own = entries.iter().map(|(row, _)| row);
        let of_children = children[column].iter().flat_map(|&child| &rows[starts[child]..starts[child + 1]]);
        for &row in own.chain(of_children).filter(|row| **row > column) {
            if seen_in[row] != column {
                seen_in[row] = column;
                of_column.push(row);
            }
        }
        of_column.sort_unstable();
        if let Some(&parent) = of_column.first() {
            children[parent].push(column);
        }
        rows.push(column);
        rows.extend(&of_column);
        starts.push(rows.len());
    }
    (starts, rows)
}

/// Some blocks of the inverse of a matrix: those where its factor has any.
#[derive(Clone, Debug)]
pub(super) struct SelectedInverse<'a> {
    factor: &'a BlockCholesky,
    /// In the order of the factor's blocks.
    values: Vec<Matrix3<f64>>,
}

impl SelectedInverse<'_> {
    /// A block of the inverse; zeros where the factor has none.
    pub(super) fn at(&self, row: usize, column: usize) -> Matrix3<f64> {
        let (low, high) = (row.max(column), row.min(column));
        let (start, end) = (self.factor.starts[high], self.factor.starts[high + 1]);
        let place = self.factor.rows[start..end].binary_search(&low);
        let block = place.map_or_else(|_| Matrix3::zeros(), |place| self.values[start + place]);
        if row >= column { block } else { block.transpose() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dissection::Dissection;
    use super::*;
    use crate::geometry::Point2;
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
        fn what_is_solved_and_the_determinant_and_the_blocks_of_the_inverse_are_those_of_the_dense_matrix(
            seed in prop::collection::vec(-1.0..1.0f64, 9 * BLOCKS * BLOCKS),
            holes in 0..100_usize,
        ) {
            let (columns, dense) = matrix(&seed, holes);
            let factor = BlockCholesky::factor(&columns, &Part::undivided(0..BLOCKS)).unwrap();
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

    #[test]
    fn sides_that_are_made_at_once_give_the_same_factor() {
        const WIDTH: usize = 36;
        let at: Vec<Point2> =
            (0..18 * WIDTH).map(|node| Point2::new((node % WIDTH) as f64, (node / WIDTH) as f64)).collect();
        let near = |node: usize| {
            let at = &at;
            (0..at.len()).filter(move |&other| other != node && (at[node] - at[other]).norm() < 1.5)
        };
        let neighbours: Vec<Vec<usize>> = (0..at.len()).map(|node| near(node).collect()).collect();
        let Dissection { places, whole } = Dissection::new(&at, &neighbours);
        assert!(whole.sides.is_some() && at.len() > 2 * LEAST_DIVIDED);
        let mut columns: Columns = vec![Vec::new(); at.len()];
        for (node, neighbours) in neighbours.iter().enumerate() {
            columns[places[node]].push((places[node], 9.0 * Matrix3::identity()));
            let later = neighbours.iter().filter(|&&other| places[other] > places[node]);
            let block = |other: usize| {
                Matrix3::from_fn(|row, column| 0.2 * ((node + 2 * other + row + 3 * column) as f64).sin())
            };
            columns[places[node]].extend(later.map(|&other| (places[other], block(other))));
        }
        let parted = BlockCholesky::factor(&columns, &whole).unwrap();
        let at_once = BlockCholesky::factor(&columns, &Part::undivided(0..at.len())).unwrap();
        let pairs = parted.blocks.iter().zip(&at_once.blocks);
        assert!(pairs.map(|(one, other)| (one - other).norm()).all(|difference| difference < 1e-12));
        let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = again.install(|| BlockCholesky::factor(&columns, &whole)).unwrap();
        assert_eq!(again.blocks, parted.blocks, "to the bit, on any number of cores");
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        for bad in [-1.0, 0.0, f64::NAN] {
            let columns =
                vec![vec![(0, Matrix3::identity()), (1, Matrix3::zeros())], vec![(1, bad * Matrix3::identity())]];
            assert!(BlockCholesky::factor(&columns, &Part::undivided(0..2)).is_none(), "{bad}");
        }
    }
}

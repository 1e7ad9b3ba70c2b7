//! Factorization of a sparse symmetric matrix of blocks of 3 x 3.
//!
//! The factor is computed column by column, each from the earlier ones that reach it (left-looking; Davis, "Direct
//! Methods for Sparse Linear Systems", 2006). Independent parts of a dissection are computed in parallel; sums are in
//! a fixed order all the same.

use super::block_cholesky::BlockCholesky;
use super::dissection::Part;
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::ops::Range;

/// Lower triangle of a symmetric matrix by columns: the entries of each in any order, and several for one position,
/// which are summed.
pub(crate) type Columns = Vec<Vec<(usize, Matrix3<f64>)>>;

/// No column.
const NONE: usize = usize::MAX;
/// Parts of fewer columns are computed by one thread.
const LEAST_DIVIDED: usize = 200;
/// Least number of columns for each thread.
const LEAST_TOGETHER: usize = 8;

/// Factors a matrix whose columns are in an order with the independent parts `whole`. `None` if it is not positive
/// definite.
pub(crate) fn factor(columns: &Columns, whole: &Part) -> Option<BlockCholesky> {
    let (starts, rows) = pattern(columns);
    let mut blocks = vec![Matrix3::zeros(); rows.len()];
    let mut inverses = vec![Matrix3::zeros(); columns.len()];
    let mut next = starts[..columns.len()].to_vec();
    let made = MadeColumns { blocks: &mut blocks, inverses: &mut inverses, next: &mut next };
    Factoring { columns, starts: &starts, rows: &rows }.factor(whole, made)?;
    Some(BlockCholesky { starts, rows, blocks, inverses })
}

/// A matrix that is being factored, and the pattern of its factor.
struct Factoring<'a> {
    columns: &'a Columns,
    starts: &'a [usize],
    rows: &'a [usize],
}

/// Columns of the factor that belong to a part.
struct MadeColumns<'a> {
    blocks: &'a mut [Matrix3<f64>],
    inverses: &'a mut [Matrix3<f64>],
    /// For each finished column, the index of its first block that is in no row of a finished column.
    next: &'a mut [usize],
}

impl<'a> MadeColumns<'a> {
    /// Splits after some columns, which have the given number of blocks.
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
    /// Computes the columns of a part: those of its two sides in parallel, as they are independent, and then those
    /// that separate them. The order of sums does not depend on which side is done first.
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

    /// Computes the columns `own` of a part that begins with the column `first`. Those before them are finished.
    fn factor_own(&self, first: usize, own: Range<usize>, made: MadeColumns<'_>) -> Option<()> {
        let MadeColumns { blocks, inverses, next } = made;
        let begin = self.starts[first];
        let (made_blocks, own_blocks) = blocks.split_at_mut(self.starts[own.start] - begin);
        self.take_off_made(first, &own, made_blocks, own_blocks, next);
        let begin = self.starts[own.start];
        // For each own column the earlier ones whose next block is in its row, by their index and that of the block.
        let mut reaching: Vec<Vec<(usize, usize)>> = vec![Vec::new(); own.len()];
        let reach = |reaching: &mut Vec<Vec<(usize, usize)>>, column: usize, block: usize| {
            if block < self.starts[column + 1] && own.contains(&self.rows[block]) {
                reaching[self.rows[block] - own.start].push((column, block));
            }
        };
        // By row, from the first own one.
        let mut work = vec![Matrix3::zeros(); self.columns.len() - own.start];
        for column in own.clone() {
            let places = self.starts[column]..self.starts[column + 1];
            for place in places.clone() {
                work[self.rows[place] - own.start] = own_blocks[place - begin];
            }
            for (before, block) in std::mem::take(&mut reaching[column - own.start]) {
                self.take_off(block..self.starts[before + 1], &own_blocks[block - begin..], &mut work, own.start);
                reach(&mut reaching, before, block + 1);
            }
            let diagonal = work[column - own.start].cholesky()?.l();
            let inverse = diagonal.try_inverse()?;
            own_blocks[places.start - begin] = diagonal;
            let by = inverse.transpose();
            for place in places.start + 1..places.end {
                own_blocks[place - begin] = work[self.rows[place] - own.start] * by;
            }
            inverses[column - first] = inverse;
            next[column - first] = places.start + self.rows[places.clone()].partition_point(|row| *row < own.end);
            reach(&mut reaching, column, places.start + 1);
        }
        Some(())
    }

    /// Initializes the own columns with those of the matrix, less the updates of finished columns. Each own column is
    /// independent of the others here.
    fn take_off_made(
        &self,
        first: usize,
        own: &Range<usize>,
        made_blocks: &[Matrix3<f64>],
        mut own_blocks: &mut [Matrix3<f64>],
        next: &mut [usize],
    ) {
        let begin = self.starts[first];
        // Blocks of finished columns in the row of each own one, by the end of their column.
        let mut in_row: Vec<Vec<Range<usize>>> = vec![Vec::new(); own.len()];
        for column in first..own.start {
            let end = self.starts[column + 1];
            let next = &mut next[column - first];
            while *next < end && own.contains(&self.rows[*next]) {
                in_row[self.rows[*next] - own.start].push(*next..end);
                *next += 1;
            }
        }
        let columns = own.clone().zip(in_row).map(|(column, in_row)| {
            let blocks = self.starts[column + 1] - self.starts[column];
            let (of_column, others) = std::mem::take(&mut own_blocks).split_at_mut(blocks);
            own_blocks = others;
            (column, in_row, of_column)
        });
        let columns: Vec<_> = columns.collect();
        let height = self.columns.len() - own.start;
        columns.into_par_iter().with_min_len(LEAST_TOGETHER).for_each_init(
            || vec![Matrix3::zeros(); height],
            |work, (column, in_row, of_column)| {
                for (row, block) in &self.columns[column] {
                    work[*row - own.start] += block;
                }
                for blocks in in_row {
                    let from = &made_blocks[blocks.start - begin..];
                    self.take_off(blocks, from, work, own.start);
                }
                for (place, block) in (self.starts[column]..).zip(of_column) {
                    *block = std::mem::take(&mut work[self.rows[place] - own.start]);
                }
            },
        );
    }

    /// Subtracts the update of another column, whose `blocks`, from that in its row on, are the first of `from`.
    /// `work` is by row, from the row `first_row` on.
    fn take_off(&self, blocks: Range<usize>, from: &[Matrix3<f64>], work: &mut [Matrix3<f64>], first_row: usize) {
        let Some(by) = from.first().map(Matrix3::transpose) else { return };
        for (row, block) in self.rows[blocks].iter().zip(from) {
            work[*row - first_row] -= block * by;
        }
    }
}

/// Pattern of the factor: start of each column, and the rows of its blocks. A column has those of the matrix, and
/// those of the columns whose first block below the diagonal is in its row (Liu 1990, "The role of elimination trees
/// in sparse factorization").
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

#[cfg(test)]
mod tests {
    use super::super::dissection::Dissection;
    use super::*;
    use crate::shared::geometry::Point2;

    #[test]
    fn sides_that_are_computed_in_parallel_give_the_same_factor() {
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
        let parted = factor(&columns, &whole).unwrap();
        let at_once = factor(&columns, &Part::undivided(0..at.len())).unwrap();
        let pairs = parted.blocks.iter().zip(&at_once.blocks);
        assert!(pairs.map(|(one, other)| (one - other).norm()).all(|difference| difference < 1e-12));
        let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = again.install(|| factor(&columns, &whole)).unwrap();
        assert_eq!(again.blocks, parted.blocks, "to the bit, on any number of cores");
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        for bad in [-1.0, 0.0, f64::NAN] {
            let columns =
                vec![vec![(0, Matrix3::identity()), (1, Matrix3::zeros())], vec![(1, bad * Matrix3::identity())]];
            assert!(factor(&columns, &Part::undivided(0..2)).is_none(), "{bad}");
        }
    }
}

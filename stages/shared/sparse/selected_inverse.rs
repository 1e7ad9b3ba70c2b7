//! The parts of the inverse of a sparse matrix that are needed.

use super::assembly_tree::{AssemblyTree, Front};
use super::block_cholesky::{BlockCholesky, FactoredFront};
use super::block_column::BlockColumn;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Blocks of the inverse of a matrix at which its factor has any.
#[derive(Clone, Debug)]
pub(crate) struct SelectedInverse<'a> {
    tree: &'a AssemblyTree,
    /// The own columns of each front, with all its rows.
    fronts: Vec<Vec<BlockColumn>>,
}

impl BlockCholesky {
    /// Computes the blocks of the inverse at which the factor has any, by the recursion of Takahashi, Fagan and Chen
    /// (1973). It takes about as long as the factorization; the whole inverse, which is dense, would take one
    /// solution for each row.
    pub(crate) fn selected_inverse(&self) -> SelectedInverse<'_> {
        let tree = &self.tree;
        let mut fronts: Vec<Vec<BlockColumn>> = vec![Vec::new(); self.fronts.len()];
        // The inverse at all rows of the fronts of the level above, which hold the rows of their children.
        let mut above: Vec<Vec<BlockColumn>> = vec![Vec::new(); self.fronts.len()];
        for (depth, level) in tree.levels.iter().enumerate() {
            let invert = |&front: &usize| {
                let parent = tree.parents[front].map(|parent| (&tree.fronts[parent], above[parent].as_slice()));
                invert(&tree.fronts[front], &self.fronts[front], parent)
            };
            let made: Vec<Vec<BlockColumn>> = level.par_iter().map(invert).collect();
            let finished = depth.checked_sub(1).map_or(&[][..], |depth| tree.levels[depth].as_slice());
            for &front in finished {
                fronts[front] = std::mem::take(&mut above[front]);
                fronts[front].truncate(tree.fronts[front].own());
            }
            for (&front, made) in level.iter().zip(made) {
                above[front] = made;
            }
        }
        for &front in tree.levels.last().into_iter().flatten() {
            fronts[front] = std::mem::take(&mut above[front]);
            fronts[front].truncate(tree.fronts[front].own());
        }
        SelectedInverse { tree, fronts }
    }
}

impl SelectedInverse<'_> {
    /// A block of the inverse; zeros where the factor has none.
    pub(crate) fn at(&self, row: usize, column: usize) -> Matrix3<f64> {
        let (low, high) = (row.max(column), row.min(column));
        let number = self.tree.front_of[high];
        let front = &self.tree.fronts[number];
        let own = &self.fronts[number][high - front.columns.start];
        let block = front.place(low).map_or_else(Matrix3::zeros, |place| own.block(place));
        if row >= column { block } else { block.transpose() }
    }
}

/// The inverse at the rows of a front, from that at the rows of its parent.
fn invert(front: &Front, factored: &FactoredFront, parent: Option<(&Front, &[BlockColumn])>) -> Vec<BlockColumn> {
    let (own, size) = (front.own(), front.size());
    let mut inverse = vec![BlockColumn::zeros(size); size];
    if let Some((parent, of_parent)) = parent {
        let places = parent.places_of(front);
        for (column, &of_column) in inverse[own..].iter_mut().zip(&places) {
            column.gather(own, &of_parent[of_column], &places);
        }
    }
    for place in (0..own).rev() {
        let (column, diagonal) = (&factored.columns[place], &factored.inverses[place]);
        let mut below = BlockColumn::zeros(size - place - 1);
        for (other, of_other) in inverse.iter().enumerate().skip(place + 1) {
            below.subtract_product(of_other, place + 1, &column.block(other - place));
        }
        below.multiply(0, diagonal);
        let of_rows = (0..below.len()).map(|row| below.block(row).tr_mul(&column.block(row + 1)));
        let own = of_rows.fold(diagonal.transpose(), |sum, of_row| sum - of_row) * diagonal;
        inverse[place].set(place, &own);
        for row in 0..below.len() {
            let block = below.block(row);
            inverse[place].set(place + 1 + row, &block);
            inverse[place + 1 + row].set(place, &block.transpose());
        }
    }
    inverse
}

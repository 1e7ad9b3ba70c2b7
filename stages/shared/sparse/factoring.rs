//! Factorization of a sparse symmetric matrix of blocks of 3 x 3.
//!
//! Each front of the factor is a dense matrix: it gathers the entries of the sparse matrix and what its children leave,
//! its own columns are eliminated, and the rest goes to its parent. Independent fronts, and the columns of a large one,
//! are computed in parallel; sums are in a fixed order all the same.

use super::Columns;
use super::assembly_tree::{AssemblyTree, Front};
use super::block_cholesky::{BlockCholesky, FactoredFront};
use super::block_column::BlockColumn;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Columns that are eliminated together, so that what they take off stays in the cache.
const TOGETHER: usize = 8;
/// Least number of columns for each thread.
const LEAST_FOR_THREAD: usize = 16;

/// Factors a matrix whose columns are in the order of elimination. `None` if it is not positive definite.
pub(crate) fn factor(matrix: &Columns) -> Option<BlockCholesky> {
    let tree = AssemblyTree::new(matrix);
    let mut factored: Vec<FactoredFront> = vec![FactoredFront::default(); tree.fronts.len()];
    // What each front leaves for its parent.
    let mut left: Vec<Vec<BlockColumn>> = vec![Vec::new(); tree.fronts.len()];
    for level in tree.levels.iter().rev() {
        let children = |&front: &usize| tree.fronts[front].children.iter();
        let of_children: Vec<Vec<_>> = level
            .iter()
            .map(|front| children(front).map(|&child| (child, std::mem::take(&mut left[child]))).collect())
            .collect();
        let eliminate = |(&front, of_children): (&usize, Vec<_>)| {
            let mut dense = assemble(&tree, &tree.fronts[front], matrix, of_children);
            let inverses = eliminate(&mut dense, tree.fronts[front].own())?;
            let rest = dense.split_off(tree.fronts[front].own());
            Some((FactoredFront { columns: dense, inverses }, rest))
        };
        let made: Vec<Option<_>> = level.par_iter().zip(of_children).map(eliminate).collect();
        for (&front, made) in level.iter().zip(made) {
            (factored[front], left[front]) = made?;
        }
    }
    Some(BlockCholesky { tree, fronts: factored })
}

/// The lower triangle of a front by columns: entries of the matrix, and what its children leave.
fn assemble(
    tree: &AssemblyTree,
    front: &Front,
    matrix: &Columns,
    of_children: Vec<(usize, Vec<BlockColumn>)>,
) -> Vec<BlockColumn> {
    let size = front.size();
    let mut dense: Vec<BlockColumn> = (0..size).map(|first| BlockColumn::zeros(size - first)).collect();
    for (place, (entries, column)) in matrix[front.columns.clone()].iter().zip(&mut dense).enumerate() {
        for (row, block) in entries {
            if let Some(of_row) = front.place(*row) {
                column.add(of_row - place, block);
            }
        }
    }
    for (child, left) in of_children {
        let places = front.places_of(&tree.fronts[child]);
        for (number, column) in left.iter().enumerate() {
            dense[places[number]].scatter(column, &places[number..], places[number]);
        }
    }
    dense
}

/// Eliminates the first `own` columns of a dense matrix, and returns the inverses of their diagonal blocks.
fn eliminate(dense: &mut [BlockColumn], own: usize) -> Option<Vec<Matrix3<f64>>> {
    let mut inverses = Vec::with_capacity(own);
    for start in (0..own).step_by(TOGETHER) {
        let end = own.min(start + TOGETHER);
        for place in start..end {
            let (before, rest) = dense.split_at_mut(place);
            let column = &mut rest[0];
            take_off(column, place, start, &before[start..]);
            let diagonal = column.block(0).cholesky()?.l();
            let inverse = diagonal.try_inverse()?;
            column.set(0, &diagonal);
            column.multiply(1, &inverse.transpose());
            inverses.push(inverse);
        }
        let (before, later) = dense.split_at_mut(end);
        let one = |(number, column): (usize, &mut BlockColumn)| take_off(column, end + number, start, &before[start..]);
        if later.len() < 2 * LEAST_FOR_THREAD {
            later.iter_mut().enumerate().for_each(one);
        } else {
            later.par_iter_mut().enumerate().with_min_len(LEAST_FOR_THREAD).for_each(one);
        }
    }
    Some(inverses)
}

/// Subtracts from the column at `place` what the eliminated columns from place `first` on have in its rows.
fn take_off(column: &mut BlockColumn, place: usize, first: usize, eliminated: &[BlockColumn]) {
    for (number, other) in eliminated.iter().enumerate() {
        let from = place - first - number;
        column.subtract_product(other, from, &other.block(from).transpose());
    }
}

//! Tests of the factor, the solution and the inverse against dense matrices.

use super::*;
use crate::shared::geometry::Point2;
use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;

const BLOCKS: usize = 12;

/// A matrix of blocks with holes, and the same as a dense one.
fn matrix(seed: &[f64], holes: usize) -> (Columns, DMatrix<f64>) {
    let sparse = DMatrix::from_fn(3 * BLOCKS, 3 * BLOCKS, |row, column| {
        let is_there = row / 3 == column / 3 || (row / 3 * 7 + column / 3 * 5 + holes).is_multiple_of(holes % 5 + 3);
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
        let factor = factor(&columns).unwrap();
        let inverse = dense.clone().try_inverse().unwrap();
        prop_assert!((factor.log_determinant() - dense.determinant().ln()).abs() < 1e-9);
        let right = DVector::from_fn(3 * BLOCKS, |row, _| seed[row]);
        let expected = &inverse * &right;
        let blocks: Vec<Vector3<f64>> = (0..BLOCKS).map(|row| right.fixed_rows::<3>(3 * row).into_owned()).collect();
        for (row, found) in factor.solve(&blocks).iter().enumerate() {
            prop_assert!((found - expected.fixed_rows::<3>(3 * row)).norm() < 1e-9);
        }
        let selected = factor.selected_inverse();
        for (column, entries) in columns.iter().enumerate() {
            for &(row, _) in entries {
                let expected = inverse.fixed_view::<3, 3>(3 * row, 3 * column).into_owned();
                prop_assert!((selected.at(row, column) - expected).norm() < 1e-9);
                prop_assert!((selected.at(column, row) - expected.transpose()).norm() < 1e-9);
            }
        }
    }
}

proptest! {
    #[test]
    fn systems_that_follow_each_other_are_solved_as_each_by_itself(
        seed in prop::collection::vec(-1.0..1.0f64, 9 * BLOCKS * BLOCKS),
        changes in prop::collection::vec(prop::collection::vec(0.0..3.0f64, BLOCKS), 1..5),
        holes in 0..100_usize,
    ) {
        let (mut columns, _) = matrix(&seed, holes);
        let right: Vec<Vector3<f64>> = (0..BLOCKS).map(|row| Vector3::from_column_slice(&seed[3 * row..][..3])).collect();
        let mut systems = SimilarSystems::default();
        for change in changes {
            for (place, by) in change.into_iter().enumerate() {
                columns[place].push((place, Matrix3::identity() * by * by * by));
            }
            let expected = factor(&columns).unwrap().solve(&right);
            let largest = expected.iter().map(Vector3::norm).fold(0.0, f64::max);
            for (found, expected) in systems.solve(&columns, &right).unwrap().iter().zip(&expected) {
                prop_assert!((found - expected).norm() <= 1e-5 * largest);
            }
        }
    }
}

#[test]
fn a_factor_of_other_size_or_of_another_matrix_is_not_taken() {
    let mut systems = SimilarSystems::default();
    let diagonal = |count: usize| -> Columns {
        (0..count).map(|place| vec![(place, Matrix3::identity() * 10f64.powi(place as i32 % 9))]).collect()
    };
    for count in [3, 100] {
        let solution = systems.solve(&diagonal(count), &vec![Vector3::x(); count]).unwrap();
        assert!((solution[2].x - 0.01).abs() < 1e-12);
        assert_eq!(systems.solve(&diagonal(count), &vec![Vector3::zeros(); count]).unwrap()[0], Vector3::zeros());
    }
    // As many different quotients as there are unknowns take more steps than there may be.
    let others: Columns = (0..100).map(|place| vec![(place, Matrix3::identity() * (1.0 + place as f64))]).collect();
    let solution = systems.solve(&others, &vec![Vector3::x(); 100]).unwrap();
    for (place, found) in solution.iter().enumerate() {
        assert!((found.x * (1.0 + place as f64) - 1.0).abs() < 1e-6, "{place}");
    }
    let not_definite: Columns = vec![vec![(0, -Matrix3::identity())]];
    assert!(systems.solve(&not_definite, &[Vector3::x()]).is_none());
}

/// A lattice of `width` times `height` nodes, each connected with those around it, in an elimination order.
fn lattice(width: usize, height: usize) -> Columns {
    let at: Vec<Point2> =
        (0..width * height).map(|node| Point2::new((node % width) as f64, (node / width) as f64)).collect();
    let near = |node: usize| {
        let at = &at;
        (0..at.len()).filter(move |&other| other != node && (at[node] - at[other]).norm() < 1.5)
    };
    let neighbours: Vec<Vec<usize>> = (0..at.len()).map(|node| near(node).collect()).collect();
    let places = minimum_degree(neighbours.clone());
    let mut columns: Columns = vec![Vec::new(); at.len()];
    for (node, neighbours) in neighbours.iter().enumerate() {
        columns[places[node]].push((places[node], 9.0 * Matrix3::identity()));
        let later = neighbours.iter().filter(|&&other| places[other] > places[node]);
        let block =
            |other: usize| Matrix3::from_fn(|row, column| 0.2 * ((node + 2 * other + row + 3 * column) as f64).sin());
        columns[places[node]].extend(later.map(|&other| (places[other], block(other))));
    }
    columns
}

#[test]
fn the_solution_of_a_large_system_is_the_same_to_the_bit_on_any_number_of_cores() {
    let columns = lattice(64, 40);
    let right: Vec<Vector3<f64>> = (0..columns.len()).map(|row| Vector3::new(1.0, (row as f64).sin(), 0.5)).collect();
    let results = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let factor = factor(&columns).unwrap();
            let inverse = factor.selected_inverse();
            let diagonal: Vec<Matrix3<f64>> = (0..columns.len()).map(|row| inverse.at(row, row)).collect();
            (factor.solve(&right), factor.log_determinant(), diagonal)
        })
    };
    let (solution, determinant, diagonal) = results(3);
    assert_eq!(results(1), (solution.clone(), determinant, diagonal));
    let mut left = right;
    for (column, entries) in columns.iter().enumerate() {
        for (row, block) in entries {
            left[*row] -= block * solution[column];
            if *row != column {
                left[column] -= block.transpose() * solution[*row];
            }
        }
    }
    assert!(left.iter().all(|left| left.norm() < 1e-9));
}

#[test]
fn a_matrix_that_is_not_positive_definite_has_no_factor() {
    for bad in [-1.0, 0.0, f64::NAN] {
        let columns = vec![vec![(0, Matrix3::identity()), (1, Matrix3::zeros())], vec![(1, bad * Matrix3::identity())]];
        assert!(factor(&columns).is_none(), "{bad}");
    }
    assert!(factor(&Vec::new()).is_some_and(|factor| factor.solve(&[]).is_empty()));
}

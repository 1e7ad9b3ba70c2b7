//! A Gaussian on cells, cut at three standard deviations.

use nalgebra::{Matrix2, Vector2};
use std::ops::RangeInclusive;

/// Standard deviations at which a kernel ends.
const CUT: f64 = 3.0;

/// The weights of the cells round a cell. They add up to 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Kernel {
    /// From the lowest row to the highest.
    rows: Vec<KernelRow>,
    weights: Vec<f32>,
}

/// The cells of one row that have a weight.
#[derive(Clone, Copy, Debug, PartialEq)]
struct KernelRow {
    /// How many rows above the cell in the middle, and how many columns right of it the first cell lies.
    row: isize,
    column: isize,
    /// Where its weights begin and end.
    start: usize,
    end: usize,
}

impl Kernel {
    /// The rows and columns that a kernel reaches to each side with that standard deviation at most, in cells.
    pub fn reach(deviation: f64) -> usize {
        (CUT * deviation).floor().clamp(0.0, 1e6) as usize
    }

    /// Makes this the kernel of a covariance, in square cells, which is positive definite, round a place that lies
    /// `off` from the middle of its cell, in cells.
    pub fn set(&mut self, covariance: &Matrix2<f64>, off: &Vector2<f64>) {
        self.rows.clear();
        self.weights.clear();
        let (xx, xy, yy) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
        let determinant = xx * yy - xy * xy;
        // With the row given, the column has the mean `slope * row` and the variance `of_column`.
        let (slope, of_column) = (xy / yy, determinant / yy);
        let reach = CUT * yy.sqrt();
        // The weights of neighbours in a row have a ratio that changes by the same factor from each to the next.
        let of_ratio = (-1.0 / of_column).exp();
        for row in whole(off.y - reach, off.y + reach) {
            let along = row as f64 - off.y;
            let left = (CUT * CUT - along * along / yy).max(0.0);
            let (middle, half) = (off.x + slope * along, (left * of_column).sqrt());
            let columns = whole(middle - half, middle + half);
            let start = self.weights.len();
            let across = *columns.start() as f64 - middle;
            let mut weight = (-0.5 * (across * across / of_column + along * along / yy)).exp();
            let mut ratio = (-(across + 0.5) / of_column).exp();
            self.rows.push(KernelRow { row, column: *columns.start(), start, end: start + columns.clone().count() });
            self.weights.extend(columns.map(|_| {
                let here = weight as f32;
                weight *= ratio;
                ratio *= of_ratio;
                here
            }));
        }
        let sum: f32 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight /= sum);
    }

    /// The rows, from the lowest: how far above the middle it lies, how far right of it the first cell, and the
    /// weights.
    pub fn rows(&self) -> impl Iterator<Item = (isize, isize, &[f32])> {
        self.rows.iter().map(|row| (row.row, row.column, &self.weights[row.start..row.end]))
    }
}

/// The whole numbers from one number to another.
fn whole(first: f64, last: f64) -> RangeInclusive<isize> {
    first.ceil() as isize..=last.floor() as isize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn kernel(xx: f64, xy: f64, yy: f64, off: Vector2<f64>) -> Kernel {
        let mut kernel = Kernel::default();
        kernel.set(&Matrix2::new(xx, xy, xy, yy), &off);
        kernel
    }

    proptest! {
        // From two cells on: where a deviation is no wider than a cell, it is the cells that shape what is cut off.
        #[test]
        fn a_kernel_has_the_mean_and_the_covariance_that_it_was_made_of(
            x in 2.0..6.0, y in 2.0..6.0, correlation in -0.8..0.8, right in -0.5..0.5, above in -0.5..0.5,
        ) {
            let expected = Matrix2::new(x * x, correlation * x * y, correlation * x * y, y * y);
            let off = Vector2::new(right, above);
            let (mut sum, mut mean, mut covariance) = (0.0, Vector2::zeros(), Matrix2::zeros());
            for (row, column, weights) in kernel(expected[(0, 0)], expected[(0, 1)], expected[(1, 1)], off).rows() {
                prop_assert!((row as f64 - above).abs() <= 3.0 * y);
                for (column, weight) in (column..).zip(weights) {
                    let place = Vector2::new(column as f64, row as f64) - off;
                    prop_assert!(place.x.abs() <= 3.0 * x && *weight > 0.0);
                    sum += f64::from(*weight);
                    mean += place * f64::from(*weight);
                    covariance += place * place.transpose() * f64::from(*weight);
                }
            }
            prop_assert!((sum - 1.0).abs() < 1e-5);
            prop_assert!(mean.norm() < 0.1, "{mean}");
            // What is cut off takes a twentieth of the variance with it.
            prop_assert!((covariance - expected * 0.95).norm() < 0.04 * expected.norm(), "{covariance} {expected}");
        }
    }

    #[test]
    fn a_kernel_that_is_narrower_than_a_cell_is_that_cell() {
        let kernel = kernel(1.0 / 12.0, 0.0, 1.0 / 12.0, Vector2::zeros());
        assert_eq!(kernel.rows().collect::<Vec<_>>(), [(0, 0, &[1.0][..])]);
    }
}

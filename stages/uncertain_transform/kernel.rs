//! A Gaussian on cells, cut at three standard deviations.

use nalgebra::Matrix2;

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

    /// Makes this the kernel of a covariance, in square cells, which is positive definite.
    pub fn set(&mut self, covariance: &Matrix2<f64>) {
        self.rows.clear();
        self.weights.clear();
        let (xx, xy, yy) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
        let determinant = xx * yy - xy * xy;
        // With the row given, the column has the mean `slope * row` and the variance `of_column`.
        let (slope, of_column) = (xy / yy, determinant / yy);
        let reach = Self::reach(yy.sqrt()) as isize;
        for row in -reach..=reach {
            let along = row as f64;
            let left = CUT * CUT - along * along / yy;
            let (middle, half) = (slope * along, (left.max(0.0) * of_column).sqrt());
            let (first, last) = ((middle - half).ceil() as isize, (middle + half).floor() as isize);
            let start = self.weights.len();
            let weight = |column: isize| {
                let off = column as f64 - middle;
                (-0.5 * (off * off / of_column + along * along / yy)).exp() as f32
            };
            self.weights.extend((first..=last).map(weight));
            self.rows.push(KernelRow { row, column: first, start, end: self.weights.len() });
        }
        let sum: f32 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight /= sum);
    }

    /// The rows, from the lowest: how far above the middle it lies, how far right of it the first cell, and the weights.
    pub fn rows(&self) -> impl Iterator<Item = (isize, isize, &[f32])> {
        self.rows.iter().map(|row| (row.row, row.column, &self.weights[row.start..row.end]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn kernel(xx: f64, xy: f64, yy: f64) -> Kernel {
        let mut kernel = Kernel::default();
        kernel.set(&Matrix2::new(xx, xy, xy, yy));
        kernel
    }

    proptest! {
        // From two cells on: where a deviation is no wider than a cell, it is the cells that shape what is cut off.
        #[test]
        fn a_kernel_has_the_covariance_that_it_was_made_of(x in 2.0..6.0, y in 2.0..6.0, correlation in -0.8..0.8) {
            let expected = Matrix2::new(x * x, correlation * x * y, correlation * x * y, y * y);
            let (mut sum, mut covariance) = (0.0, Matrix2::zeros());
            for (row, column, weights) in kernel(expected[(0, 0)], expected[(0, 1)], expected[(1, 1)]).rows() {
                prop_assert!(row.unsigned_abs() <= Kernel::reach(y));
                for (off, weight) in (column..).zip(weights) {
                    let place = nalgebra::Vector2::new(off as f64, row as f64);
                    prop_assert!(off.unsigned_abs() <= Kernel::reach(x) && *weight > 0.0);
                    sum += f64::from(*weight);
                    covariance += place * place.transpose() * f64::from(*weight);
                }
            }
            prop_assert!((sum - 1.0).abs() < 1e-5);
            // What is cut off takes a twentieth of the variance with it.
            prop_assert!((covariance - expected * 0.95).norm() < 0.04 * expected.norm(), "{covariance} {expected}");
        }
    }

    #[test]
    fn a_kernel_that_is_narrower_than_a_cell_is_that_cell() {
        let rows: Vec<_> = kernel(1.0 / 12.0, 0.0, 1.0 / 12.0).rows().map(|(r, c, w)| (r, c, w.to_vec())).collect();
        assert_eq!(rows, [(0, 0, vec![1.0])]);
    }
}

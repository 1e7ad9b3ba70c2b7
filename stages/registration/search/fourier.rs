//! The Fourier transform of a plane of complex numbers.

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Number of rows that are transposed at once: their numbers fill a line of the cache.
const ROWS: usize = 8;

/// Fourier transform of planes of one size.
pub(super) struct Fourier {
    /// Numbers in a row.
    pub(super) width: usize,
    /// Number of rows.
    pub(super) height: usize,
    rows: Arc<dyn Fft<f32>>,
    rows_back: Arc<dyn Fft<f32>>,
    columns: Arc<dyn Fft<f32>>,
    columns_back: Arc<dyn Fft<f32>>,
}

/// Buffers of a transform, one set for each thread.
pub(super) struct Buffers {
    /// Row by row.
    pub(super) plane: Vec<Complex32>,
    /// Column by column.
    pub(super) spectrum: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Fourier {
    /// Transform of planes of at least this size.
    pub(super) fn new(least_width: usize, least_height: usize) -> Self {
        let (width, height) = (fast_size(least_width), fast_size(least_height));
        let mut planner = FftPlanner::new();
        Self {
            width,
            height,
            rows: planner.plan_fft_forward(width),
            rows_back: planner.plan_fft_inverse(width),
            columns: planner.plan_fft_forward(height),
            columns_back: planner.plan_fft_inverse(height),
        }
    }

    pub(super) fn buffers(&self) -> Buffers {
        let zero = Complex32::new(0.0, 0.0);
        let plans = [&self.rows, &self.rows_back, &self.columns, &self.columns_back];
        let scratch = plans.iter().map(|plan| plan.get_inplace_scratch_len()).max().unwrap_or(0);
        let numbers = vec![zero; self.width * self.height];
        Buffers { spectrum: numbers.clone(), plane: numbers, scratch: vec![zero; scratch] }
    }

    /// Computes the spectrum of a plane of which only the first `filled` rows are not zero. Overwrites the plane.
    pub(super) fn forward(&self, buffers: &mut Buffers, filled: usize) {
        let Buffers { plane, spectrum, scratch } = buffers;
        let plane = &mut plane[..filled.min(self.height) * self.width];
        self.rows.process_with_scratch(plane, scratch);
        spectrum.fill(Complex32::new(0.0, 0.0));
        transpose(plane, self.width, spectrum, self.height);
        self.columns.process_with_scratch(spectrum, scratch);
    }

    /// Computes the plane of a spectrum, `width * height` times too large. Overwrites the spectrum.
    pub(super) fn inverse(&self, buffers: &mut Buffers) {
        let Buffers { plane, spectrum, scratch } = buffers;
        self.columns_back.process_with_scratch(spectrum, scratch);
        transpose(spectrum, self.height, plane, self.width);
        self.rows_back.process_with_scratch(plane, scratch);
    }
}

/// Copies rows of `width` numbers to columns of `height`.
fn transpose(rows: &[Complex32], width: usize, columns: &mut [Complex32], height: usize) {
    for (number, rows) in rows.chunks(ROWS * width).enumerate() {
        let first = number * ROWS;
        if rows.len() < ROWS * width {
            for (row, numbers) in (first..).zip(rows.chunks_exact(width)) {
                columns[row..].iter_mut().step_by(height).zip(numbers).for_each(|(to, from)| *to = *from);
            }
            continue;
        }
        let rows: [&[Complex32]; ROWS] = std::array::from_fn(|row| &rows[row * width..][..width]);
        for (column, numbers) in columns.chunks_exact_mut(height).enumerate() {
            numbers[first..first + ROWS].iter_mut().zip(&rows).for_each(|(to, row)| *to = row[column]);
        }
    }
}

/// Least product of 2, 3 and 5 from `least` up: transforms of that size are fast.
fn fast_size(least: usize) -> usize {
    let is_fast = |size: &usize| {
        let mut rest = *size;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    (least.max(1)..).find(is_fast).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sizes_are_quick_to_transform() {
        assert_eq!([0, 7, 101, 487, 513].map(fast_size), [1, 8, 108, 500, 540]);
    }

    proptest! {
        #[test]
        fn the_inverse_of_the_spectrum_is_the_plane(width in 1usize..40, height in 1usize..40, filled in 0usize..40) {
            let fourier = Fourier::new(width, height);
            let mut buffers = fourier.buffers();
            let filled = filled.min(fourier.height);
            for (index, number) in buffers.plane[..filled * fourier.width].iter_mut().enumerate() {
                *number = Complex32::new((index % 7) as f32, (index % 5) as f32);
            }
            let (plane, size) = (buffers.plane.clone(), buffers.plane.len() as f32);
            fourier.forward(&mut buffers, filled);
            fourier.inverse(&mut buffers);
            for (number, expected) in buffers.plane.iter().zip(&plane) {
                prop_assert!((number / size - expected).norm() < 1e-4);
            }
        }
    }
}

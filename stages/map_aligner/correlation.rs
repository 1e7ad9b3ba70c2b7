//! The score of every translation of one map on another, at one rotation.

use super::raster::{Content, Raster};
use nalgebra::Vector2;
use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Scores translations of map b on map a, which stays.
///
/// A translation's score is the number of cells in which dilated walls of both maps meet, less `penalty` times the
/// number in which a dilated wall of one meets free space of the other. Each of these sums is a cross-correlation, and
/// so a product of spectra (the convolution theorem).
pub struct Correlator {
    transform: Transform2,
    /// Spectrum of a's walls less `penalty` times a's free space: what a wall of b meets.
    for_walls: Vec<Complex32>,
    /// Spectrum of a's walls times `-penalty`: what free space of b meets.
    for_free: Vec<Complex32>,
}

/// Scores by translation, in cells, and what it takes to make them: made once for each thread.
pub struct Workspace {
    plane: Vec<f32>,
    spectrum: Vec<Complex32>,
    product: Vec<Complex32>,
    lines: Lines,
    /// Cells of the raster that was filled in last, along x and y.
    size: (usize, usize),
}

/// A translation in cells, and its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BestShift {
    /// What is added to the column and row of a cell of raster b for that of raster a.
    pub(super) shift: Vector2<f64>,
    /// Rounded to whole cells, so that the rounding errors of the transform decide nothing.
    pub(super) score: f64,
}

impl Correlator {
    /// For a raster `a` and rasters b of at most `width_b` x `height_b` cells.
    pub fn new(a: &Raster, width_b: usize, height_b: usize, penalty: f64) -> Self {
        let transform = Transform2::new(a.width + width_b, a.height + height_b);
        let mut workspace = transform.workspace();
        let penalty = penalty as f32;
        workspace.fill(&transform, a, |content| weight_of_wall(content, penalty));
        transform.forward(&mut workspace, a.height);
        let for_walls = workspace.spectrum.clone();
        workspace.fill(&transform, a, |content| if content.is_near_wall() { -penalty } else { 0.0 });
        transform.forward(&mut workspace, a.height);
        Self { for_walls, for_free: workspace.spectrum.clone(), transform }
    }

    /// A workspace for the calling thread.
    pub fn workspace(&self) -> Workspace {
        self.transform.workspace()
    }

    /// Scores all translations of raster `b`.
    pub fn correlate(&self, b: &Raster, workspace: &mut Workspace) {
        workspace.fill(&self.transform, b, |content| if content.is_near_wall() { 1.0 } else { 0.0 });
        self.transform.forward(workspace, b.height);
        for ((product, a), b) in workspace.product.iter_mut().zip(&self.for_walls).zip(&workspace.spectrum) {
            *product = a * b.conj();
        }
        workspace.fill(&self.transform, b, |content| if content == Content::Free { 1.0 } else { 0.0 });
        self.transform.forward(workspace, b.height);
        for ((product, a), b) in workspace.product.iter_mut().zip(&self.for_free).zip(&workspace.spectrum) {
            *product += a * b.conj();
        }
        self.transform.inverse(workspace);
    }

    /// The best translation of those just scored, of equals the first by row, then by column. With `excluded`, a place
    /// and a radius in cells, only what is farther away counts.
    pub(super) fn best(&self, workspace: &Workspace, excluded: Option<(Vector2<f64>, f64)>) -> BestShift {
        let Transform2 { width, height, .. } = self.transform;
        // A shift below zero has wrapped round.
        let signed = |index: usize, period: usize, b: usize| match index + b >= period {
            true => index as f64 - period as f64,
            false => index as f64,
        };
        let (wrap_x, wrap_y) = workspace.size;
        let mut best = BestShift { shift: Vector2::zeros(), score: f64::NEG_INFINITY };
        for row in 0..height {
            let y = signed(row, height, wrap_y);
            for (column, score) in workspace.plane[row * width..(row + 1) * width].iter().enumerate() {
                if f64::from(*score) <= best.score - 1.0 {
                    continue;
                }
                let shift = Vector2::new(signed(column, width, wrap_x), y);
                let score = f64::from(score.round());
                if score > best.score && excluded.is_none_or(|(place, radius)| (shift - place).norm() > radius) {
                    best = BestShift { shift, score };
                }
            }
        }
        best
    }
}

fn weight_of_wall(content: Content, penalty: f32) -> f32 {
    match content {
        Content::Wall | Content::BesideWall => 1.0,
        Content::Free => -penalty,
        Content::Unknown => 0.0,
    }
}

/// The Fourier transform of a plane of real numbers, its spectrum column by column.
struct Transform2 {
    width: usize,
    height: usize,
    rows: Arc<dyn RealToComplex<f32>>,
    rows_back: Arc<dyn ComplexToReal<f32>>,
    columns: Arc<dyn Fft<f32>>,
    columns_back: Arc<dyn Fft<f32>>,
}

/// Buffers for single rows and columns.
struct Lines {
    row: Vec<Complex32>,
    real_scratch: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl Transform2 {
    fn new(least_width: usize, least_height: usize) -> Self {
        let (width, height) = (fast_size(least_width), fast_size(least_height));
        let (mut real, mut complex) = (RealFftPlanner::new(), FftPlanner::new());
        Self {
            width,
            height,
            rows: real.plan_fft_forward(width),
            rows_back: real.plan_fft_inverse(width),
            columns: complex.plan_fft_forward(height),
            columns_back: complex.plan_fft_inverse(height),
        }
    }

    /// Columns of a spectrum; the others follow from them, as the plane is real.
    fn spectrum_width(&self) -> usize {
        self.width / 2 + 1
    }

    fn workspace(&self) -> Workspace {
        let zero = Complex32::new(0.0, 0.0);
        let spectrum = vec![zero; self.spectrum_width() * self.height];
        let real_scratch = self.rows.get_scratch_len().max(self.rows_back.get_scratch_len());
        let scratch = self.columns.get_inplace_scratch_len().max(self.columns_back.get_inplace_scratch_len());
        Workspace {
            plane: vec![0.0; self.width * self.height],
            product: spectrum.clone(),
            spectrum,
            lines: Lines {
                row: vec![zero; self.spectrum_width()],
                real_scratch: vec![zero; real_scratch],
                scratch: vec![zero; scratch],
            },
            size: (0, 0),
        }
    }

    /// The spectrum of a plane of which only the first `filled` rows are not zero. The plane is lost.
    fn forward(&self, workspace: &mut Workspace, filled: usize) {
        let Workspace { plane, spectrum, lines, .. } = workspace;
        spectrum.fill(Complex32::new(0.0, 0.0));
        for (row, values) in plane.chunks_exact_mut(self.width).take(filled).enumerate() {
            // The lengths fit, as they come from the same plan.
            let done = self.rows.process_with_scratch(values, &mut lines.row, &mut lines.real_scratch);
            debug_assert!(done.is_ok());
            for (column, value) in lines.row.iter().enumerate() {
                spectrum[column * self.height + row] = *value;
            }
        }
        self.columns.process_with_scratch(spectrum, &mut lines.scratch);
    }

    /// The plane of the spectrum `product`, which is lost.
    fn inverse(&self, workspace: &mut Workspace) {
        let Workspace { plane, product, lines, .. } = workspace;
        self.columns_back.process_with_scratch(product, &mut lines.scratch);
        let scale = 1.0 / (self.width * self.height) as f32;
        for (row, values) in plane.chunks_exact_mut(self.width).enumerate() {
            for (column, value) in lines.row.iter_mut().enumerate() {
                *value = product[column * self.height + row] * scale;
            }
            // These are real but for rounding, as the plane is and its width is even.
            lines.row[0].im = 0.0;
            if let Some(last) = lines.row.last_mut() {
                last.im = 0.0;
            }
            let done = self.rows_back.process_with_scratch(&mut lines.row, values, &mut lines.real_scratch);
            debug_assert!(done.is_ok());
        }
    }
}

impl Workspace {
    /// Writes a raster into the plane, as numbers, and zeros round it.
    fn fill(&mut self, transform: &Transform2, raster: &Raster, number: impl Fn(Content) -> f32) {
        self.plane.fill(0.0);
        self.size = (raster.width, raster.height);
        let rows = raster.cells.chunks(raster.width.max(1));
        for (values, cells) in self.plane.chunks_exact_mut(transform.width).zip(rows) {
            for (value, content) in values.iter_mut().zip(cells) {
                *value = number(*content);
            }
        }
    }
}

/// The least number from `least` up that is even and a product of 2, 3 and 5, of which transforms are quick.
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
    (least.max(2)..).find(|size| size.is_multiple_of(2) && is_fast(size)).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn raster(width: usize, height: usize, cells: Vec<Content>) -> Raster {
        let mut raster = Raster::default();
        (raster.width, raster.height, raster.cells) = (width, height, cells);
        raster
    }

    fn content() -> impl Strategy<Value = Content> {
        prop::sample::select(vec![Content::Unknown, Content::Free, Content::BesideWall, Content::Wall])
    }

    fn any_raster() -> impl Strategy<Value = Raster> {
        (1usize..9, 1usize..9).prop_flat_map(|(width, height)| {
            prop::collection::vec(content(), width * height).prop_map(move |cells| raster(width, height, cells))
        })
    }

    /// The score of one shift by the definition.
    fn counted(a: &Raster, b: &Raster, x: i64, y: i64, penalty: f64) -> f64 {
        let at = |raster: &Raster, column: i64, row: i64| match (usize::try_from(column), usize::try_from(row)) {
            (Ok(column), Ok(row)) if column < raster.width && row < raster.height => {
                raster.cells[row * raster.width + column]
            }
            _ => Content::Unknown,
        };
        let mut score = 0.0;
        for row in 0..b.height as i64 {
            for column in 0..b.width as i64 {
                score += match (at(a, column + x, row + y), at(b, column, row)) {
                    (one, other) if one.is_near_wall() && other.is_near_wall() => 1.0,
                    (one, Content::Free) if one.is_near_wall() => -penalty,
                    (Content::Free, other) if other.is_near_wall() => -penalty,
                    _ => 0.0,
                };
            }
        }
        score
    }

    proptest! {
        #[test]
        fn the_best_shift_is_the_one_that_counting_finds(a in any_raster(), b in any_raster()) {
            let correlator = Correlator::new(&a, b.width, b.height, 0.6);
            let mut workspace = correlator.workspace();
            correlator.correlate(&b, &mut workspace);
            let found = correlator.best(&workspace, None);
            let score = counted(&a, &b, found.shift.x as i64, found.shift.y as i64, 0.6);
            prop_assert_eq!(score.round(), found.score);
            for y in -(b.height as i64)..=a.height as i64 {
                for x in -(b.width as i64)..=a.width as i64 {
                    prop_assert!(counted(&a, &b, x, y, 0.6).round() <= found.score);
                }
            }
            let elsewhere = correlator.best(&workspace, Some((found.shift, 2.0)));
            prop_assert!((elsewhere.shift - found.shift).norm() > 2.0 || elsewhere.score == f64::NEG_INFINITY);
        }
    }

    #[test]
    fn sizes_are_quick_to_transform() {
        assert_eq!([0, 7, 101, 487, 513].map(fast_size), [2, 8, 108, 500, 540]);
    }
}

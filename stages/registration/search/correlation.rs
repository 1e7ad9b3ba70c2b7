//! Score of every translation of one map on another, at one rotation and at the opposite one.

use super::best_blocks::{BestBlocks, Block};
use super::fourier::{Buffers, Fourier};
use super::known_cells::KnownCells;
use super::raster::Content;
use nalgebra::Vector2;
use rustfft::num_complex::Complex32;

/// Scores translations of map b on map a.
///
/// Both maps are drawn in cells twice as wide as those of their rasters, as shares of dilated wall and of free space.
/// The score of a translation is the sum over all cells of the product of both maps' walls, less `penalty` times the
/// products of walls of one and free space of the other. Each of these sums is a cross-correlation, and so a product
/// of spectra (the convolution theorem).
///
/// Walls and free space of b are the real and the imaginary part of one plane. Turned by another half turn, its
/// spectrum is the complex conjugate but for a shift; so the scores of two opposite rotations are the real and the
/// imaginary part of one plane, too.
pub struct Correlator {
    fourier: Fourier,
    /// The side of a cell, metres.
    cell: f64,
    /// Lower corner of map a, metres.
    corner: Vector2<f64>,
    /// Spectrum of a's walls less `penalty` times a's free space, which is multiplied with the walls of b. Only its
    /// first half, as the other is the complex conjugate.
    for_walls: Vec<Complex32>,
    /// Spectrum of a's walls times `-penalty`, which is multiplied with the free space of b. Only its first half.
    for_free: Vec<Complex32>,
}

/// Buffers of one thread, and the scores of the last translations.
pub struct Workspace {
    buffers: Buffers,
    /// Lower corner of map b as it was turned, and its number of cells along x and y.
    corner: Vector2<f64>,
    size: (usize, usize),
}

/// A translation of map b, turned by some angle, and its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredShift {
    /// The translation, metres.
    pub translation: Vector2<f64>,
    /// Rounded to whole cells, so that rounding errors of the transform do not matter.
    pub score: f64,
}

impl Correlator {
    /// Correlator of a map `a` with maps b in cells of the same size, of which each, turned, is at most `size_b` metres
    /// long along x and along y.
    pub fn new(a: &KnownCells<'_>, size_b: Vector2<f64>, penalty: f64) -> Self {
        let cell = 2.0 * a.raster().cell;
        let (_, size_a) = a.box_turned(0.0);
        let cells = size_a.map(|side| cells_of(side, cell)) + size_b.map(|side| cells_of(side, cell));
        let fourier = Fourier::new(cells.x, cells.y);
        let mut workspace = Workspace::new(&fourier);
        workspace.draw(&fourier, a, 0.0, cell);
        fourier.forward(&mut workspace.buffers, workspace.size.1);
        let scale = 1.0 / (fourier.width * fourier.height) as f32;
        let penalty = penalty as f32;
        let (mut for_walls, mut for_free) = (Vec::new(), Vec::new());
        for_each_opposite(&fourier, &mut workspace.buffers.spectrum, |_, column, opposite| {
            for (at, opposite) in column.iter().zip(opposite) {
                let (walls, free) = split(at, opposite);
                for_walls.push((walls - free * penalty) * scale);
                for_free.push(walls * (-penalty * scale));
            }
        });
        Self { cell, corner: workspace.corner, for_walls, for_free, fourier }
    }

    /// A workspace for the calling thread.
    pub fn workspace(&self) -> Workspace {
        Workspace::new(&self.fourier)
    }

    /// Scores all translations of map `b` turned by `angle`, and by half a turn more, about the origin of its frame.
    pub fn correlate(&self, b: &KnownCells<'_>, angle: f64, workspace: &mut Workspace) {
        workspace.draw(&self.fourier, b, angle, self.cell);
        self.fourier.forward(&mut workspace.buffers, workspace.size.1);
        for_each_opposite(&self.fourier, &mut workspace.buffers.spectrum, |start, column, opposite| {
            let of_a = self.for_walls[start..].iter().zip(&self.for_free[start..]);
            for ((at, opposite), (for_walls, for_free)) in column.iter_mut().zip(opposite).zip(of_a) {
                let (walls, free) = split(at, opposite);
                let forth = for_walls * walls.conj() + for_free * free.conj();
                let back = for_walls * walls + for_free * free;
                *at = Complex32::new(forth.re - back.im, forth.im + back.re);
                *opposite = Complex32::new(forth.re + back.im, back.re - forth.im);
            }
        });
        self.fourier.inverse(&mut workspace.buffers);
    }

    /// The best translation in each block of `side` metres, of those last scored at `angle` and of those half a turn
    /// on, if its score is above zero; of these the best `most`, the best first.
    pub fn best_of_blocks(&self, workspace: &Workspace, side: f64, most: usize) -> [Vec<ScoredShift>; 2] {
        let side = ((side / self.cell).round() as usize).max(1);
        let [forth, opposite] = self.blocks(&workspace.buffers.plane, side, most);
        [
            self.best_shifts(workspace, false, side, forth.sorted(), |score| score.re),
            self.best_shifts(workspace, true, side, opposite.sorted(), |score| score.im),
        ]
    }

    /// The best translations of some blocks of `side` cells.
    fn best_shifts(
        &self,
        workspace: &Workspace,
        opposite: bool,
        side: usize,
        blocks: Vec<Block>,
        score: impl Fn(&Complex32) -> f32,
    ) -> Vec<ScoredShift> {
        let plane = &workspace.buffers.plane;
        let shift = |block: Block| {
            let (width, height) = (self.fourier.width, self.fourier.height);
            let columns = || block.column..(block.column + side).min(width);
            let mut places = (block.row..(block.row + side).min(height)).flat_map(|y| columns().map(move |x| (x, y)));
            let (x, y) = places.find(|(x, y)| rounded(score(&plane[y * width + x])) == block.score)?;
            Some(ScoredShift {
                translation: self.translation(workspace, opposite, x, y),
                score: f64::from(block.score),
            })
        };
        blocks.into_iter().filter_map(shift).collect()
    }

    /// The best `most` blocks whose best score is above zero: of the real, and of the imaginary part of a plane.
    fn blocks(&self, plane: &[Complex32], side: usize, most: usize) -> [BestBlocks; 2] {
        let width = self.fourier.width;
        let zero = Complex32::new(0.0, 0.0);
        let (mut forth, mut opposite) = (BestBlocks::new(most), BestBlocks::new(most));
        let mut best_of_columns = vec![zero; width];
        for (number, rows) in plane.chunks(side * width).enumerate() {
            best_of_columns.fill(zero);
            for row in rows.chunks_exact(width) {
                best_of_columns.iter_mut().zip(row).for_each(|(best, scores)| *best = greater(best, scores));
            }
            for (place, columns) in best_of_columns.chunks(side).enumerate() {
                let best = columns.iter().fold(zero, |most, scores| greater(&most, scores));
                for (blocks, score) in [(&mut forth, rounded(best.re)), (&mut opposite, rounded(best.im))] {
                    if score > blocks.too_little {
                        blocks.add(Block { score, row: number * side, column: place * side });
                    }
                }
            }
        }
        [forth, opposite]
    }

    /// The translation of a column and row of the plane of scores.
    fn translation(&self, workspace: &Workspace, opposite: bool, column: usize, row: usize) -> Vector2<f64> {
        let Fourier { width, height, .. } = self.fourier;
        let (width_b, height_b) = workspace.size;
        let (corner, x, y) = match opposite {
            true => {
                // A convolution: the last cell of b, turned, comes first.
                let size = Vector2::new(width_b as f64, height_b as f64);
                let (x, y) = (column as f64 + 1.0 - size.x, row as f64 + 1.0 - size.y);
                (-(workspace.corner + size * self.cell), x, y)
            }
            false => (workspace.corner, signed(column, width, width_b), signed(row, height, height_b)),
        };
        self.corner - corner + Vector2::new(x, y) * self.cell
    }
}

/// A score in whole cells.
fn rounded(score: f32) -> i32 {
    (score + 0.5) as i32
}

/// A negative shift is wrapped round.
fn signed(index: usize, period: usize, size_b: usize) -> f64 {
    match index + size_b > period {
        true => index as f64 - period as f64,
        false => index as f64,
    }
}

/// Number of cells that a length covers, wherever it begins.
fn cells_of(length: f64, cell: f64) -> usize {
    (length / cell) as usize + 2
}

/// The greater real part of two numbers, and the greater imaginary part.
fn greater(one: &Complex32, other: &Complex32) -> Complex32 {
    let greater = |one: f32, other: f32| if other > one { other } else { one };
    Complex32::new(greater(one.re, other.re), greater(one.im, other.im))
}

/// Visits the first half of the columns of a spectrum: the index of the first number of each, the column, and the
/// numbers of the opposite frequencies. Both may be changed; of the column that is its own opposite, the first
/// counts.
fn for_each_opposite(
    fourier: &Fourier,
    spectrum: &mut [Complex32],
    mut visit: impl FnMut(usize, &mut [Complex32], &mut [Complex32]),
) {
    let (width, height) = (fourier.width, fourier.height);
    let mut mirrored = vec![Complex32::new(0.0, 0.0); height];
    for number in 0..=width / 2 {
        let opposite = (width - number) % width * height;
        mirror(&spectrum[opposite..opposite + height], &mut mirrored);
        let start = number * height;
        visit(start, &mut spectrum[start..start + height], &mut mirrored);
        if opposite != start {
            mirror(&mirrored, &mut spectrum[opposite..opposite + height]);
        }
    }
}

/// Copies a column with its frequencies in reverse order.
fn mirror(from: &[Complex32], to: &mut [Complex32]) {
    to[0] = from[0];
    to[1..].iter_mut().zip(from[1..].iter().rev()).for_each(|(to, from)| *to = *from);
}

/// The spectra of the real and of the imaginary part of a plane.
fn split(at: &Complex32, opposite: &Complex32) -> (Complex32, Complex32) {
    let (sum, difference) = (at + opposite.conj(), at - opposite.conj());
    (sum * 0.5, Complex32::new(difference.im, -difference.re) * 0.5)
}

impl Workspace {
    fn new(fourier: &Fourier) -> Self {
        Self { buffers: fourier.buffers(), corner: Vector2::zeros(), size: (0, 0) }
    }

    /// Draws a turned map into the plane: the share of each cell that is near a wall, and the share that is free.
    fn draw(&mut self, fourier: &Fourier, map: &KnownCells<'_>, angle: f64, cell: f64) {
        let (least, size) = map.box_turned(angle);
        let side = map.raster().cell;
        // The least coordinates are in the middle of the first cell, so rounding cannot move them outside.
        self.corner = least - Vector2::repeat(0.5 * side);
        self.size = (cells_of(size.x, cell).min(fourier.width), cells_of(size.y, cell).min(fourier.height));
        let plane = &mut self.buffers.plane;
        plane[..self.size.1 * fourier.width].fill(Complex32::new(0.0, 0.0));
        let share = ((side * side) / (cell * cell)) as f32;
        let (free, wall) = (Complex32::new(0.0, share), Complex32::new(share, 0.0));
        let mut values = [Complex32::new(0.0, 0.0); 4];
        values[Content::Free as usize] = free;
        values[Content::BesideWall as usize] = wall;
        values[Content::Wall as usize] = wall;
        map.visit_turned(angle, &self.corner, cell, fourier.width, |content, place| {
            if let Some(cell) = plane.get_mut(place) {
                *cell += values[content as usize];
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::Raster;
    use super::*;
    use proptest::prelude::*;

    /// A raster with a rim of unknown cells, its first known cell at the origin.
    fn raster(width: usize, height: usize, contents: &[Content]) -> Raster {
        let (rim, cell) = (3, 0.5);
        let mut raster = Raster {
            corner: Vector2::repeat(-(rim as f64) * cell),
            cell,
            width: width + 2 * rim,
            height: height + 2 * rim,
            cells: vec![Content::Unknown; (width + 2 * rim) * (height + 2 * rim)],
        };
        for (row, contents) in contents.chunks(width).enumerate() {
            let start = (row + rim) * raster.width + rim;
            raster.cells[start..start + width].copy_from_slice(contents);
        }
        raster
    }

    fn any_raster() -> impl Strategy<Value = Raster> {
        let content = prop::sample::select(vec![Content::Free, Content::BesideWall, Content::Wall, Content::Unknown]);
        (1usize..12, 1usize..12).prop_flat_map(move |(width, height)| {
            let contents = prop::collection::vec(content.clone(), width * height);
            contents.prop_map(move |mut contents| {
                // The corners are known, so that the bounding box is the raster's.
                let last = contents.len() - 1;
                (contents[0], contents[last]) = (Content::Free, Content::Free);
                raster(width, height, &contents)
            })
        })
    }

    /// The numbers of a raster in wide cells, as they are drawn.
    fn drawn(raster: &Raster, opposite: bool) -> (Vec<Vec<Complex32>>, Vector2<f64>) {
        let fourier = Fourier::new(16, 16);
        let mut workspace = Workspace::new(&fourier);
        workspace.draw(&fourier, &KnownCells::new(raster), 0.0, 2.0 * raster.cell);
        let (width, height) = workspace.size;
        let rows = workspace.buffers.plane.chunks(fourier.width).take(height);
        let mut rows: Vec<Vec<Complex32>> = rows.map(|row| row[..width].to_vec()).collect();
        if !opposite {
            return (rows, workspace.corner);
        }
        rows.reverse();
        rows.iter_mut().for_each(|row| row.reverse());
        (rows, -(workspace.corner + Vector2::new(width as f64, height as f64) * 2.0 * raster.cell))
    }

    /// The best score of all translations by the definition, and that of the found translation.
    fn counted(a: &Raster, b: &Raster, opposite: bool, penalty: f32, found: &Vector2<f64>) -> (f32, f32) {
        let ((cells_a, corner_a), (cells_b, corner_b)) = (drawn(a, false), drawn(b, opposite));
        let score_at = |x: i64, y: i64| {
            let mut score = 0.0;
            for (row, cells) in (0..).zip(&cells_b) {
                for (column, b) in (0..).zip(cells) {
                    let row = usize::try_from(row + y).ok().and_then(|row| cells_a.get(row));
                    let column = usize::try_from(column + x).ok();
                    let Some(a) = row.zip(column).and_then(|(row, column)| row.get(column)) else { continue };
                    score += a.re * b.re - penalty * (a.re * b.im + a.im * b.re);
                }
            }
            score
        };
        let all = (-12..12).flat_map(|y| (-12..12).map(move |x| (x, y)));
        let best = all.map(|(x, y)| score_at(x, y)).fold(0.0, f32::max);
        let place = (found - (corner_a - corner_b)) / (2.0 * a.cell);
        (best, score_at(place.x.round() as i64, place.y.round() as i64))
    }

    proptest! {
        #[test]
        fn the_best_shift_is_the_one_that_counting_finds(a in any_raster(), b in any_raster()) {
            let known_b = KnownCells::new(&b);
            let (_, size) = known_b.box_turned(0.0);
            let correlator = Correlator::new(&KnownCells::new(&a), size, 0.6);
            let mut workspace = correlator.workspace();
            correlator.correlate(&known_b, 0.0, &mut workspace);
            for opposite in [false, true] {
                let [forth, back] = correlator.best_of_blocks(&workspace, 2.0, 3);
                let best = if opposite { back } else { forth };
                let score = best.first().map_or(0.0, |best| best.score);
                let translation = best.first().map_or(Vector2::zeros(), |best| best.translation);
                let (most, there) = counted(&a, &b, opposite, 0.6, &translation);
                prop_assert!((score - f64::from(most)).abs() < 0.51, "{score} {most}");
                prop_assert!(best.is_empty() || (score - f64::from(there)).abs() < 0.51, "{score} {there}");
                prop_assert!(best.is_sorted_by(|one, other| one.score >= other.score) && best.len() <= 3);
            }
        }
    }
}

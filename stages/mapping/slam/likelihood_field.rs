//! The likelihood field of a set of points: how near a place is to the nearest of them.

use crate::shared::geometry::Point2;
use std::ops::Range;

/// Side of a cell, metres.
pub(super) const CELL: f64 = 0.05;
/// Standard deviation of a hit about the wall, metres.
const DEVIATION: f64 = 0.06;
/// Cells to each side that a point reaches, and the side of the square of all of them.
const REACH: i64 = 3;
const SIDE: usize = 2 * REACH as usize + 1;
/// Cells of a row that are raised together: those that a point reaches, and one more, which it does not.
const TOGETHER: usize = SIDE + 1;
/// Most levels of the pyramid: the highest has the maximum of 32 by 32 cells.
const MAX_LEVELS: usize = 6;

/// The likelihood field `exp(-d^2 / 2 s^2)` of the distance d to the nearest point (Thrun, Burgard and Fox,
/// "Probabilistic Robotics", section 6.4), with the maxima of its neighbourhoods, for branch and bound (Hess et al.
/// 2016, equation 17).
#[derive(Clone, Debug)]
pub(super) struct LikelihoodField {
    corner: Point2,
    width: usize,
    height: usize,
    /// Level k has for each cell the maximum of the 2^k by 2^k cells from it to higher x and y. 255 is 1.
    levels: Vec<Vec<u8>>,
}

impl LikelihoodField {
    /// Draws the points that lie in the rectangle between two corners, with as many levels as a search needs in a window
    /// of which half is given, metres.
    pub(super) fn new(points: impl Iterator<Item = Point2>, [low, high]: &[Point2; 2], half_window: f64) -> Self {
        let cells = |extent: f64| (extent / CELL).ceil().max(1.0) as usize;
        let (width, height) = (cells(high.x - low.x), cells(high.y - low.y));
        let widest = (half_window / CELL).ceil().max(1.0);
        // The highest has squares that are wider than half the window.
        let levels = (1..MAX_LEVELS).find(|levels| f64::from(1 << (levels - 1)) > widest).unwrap_or(MAX_LEVELS);
        let mut field = Self { corner: *low, width, height, levels: Vec::with_capacity(levels) };
        let mut cells = vec![0u8; width * height];
        for point in points {
            field.stamp(&mut cells, &point);
        }
        field.levels.push(cells);
        for level in 1..levels {
            let below = &field.levels[level - 1];
            let above = field.maxima(below, 1 << (level - 1));
            field.levels.push(above);
        }
        field
    }

    /// Raises the cells around a point to their likelihood, which is the product of one along x and one along y.
    fn stamp(&self, cells: &mut [u8], point: &Point2) {
        let at = (point - self.corner) / CELL;
        let (columns, rows) = (around(at.x, self.width), around(at.y, self.height));
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let by_column = likelihoods(columns.start as f64 + 0.5 - at.x).map(|likelihood| 255.0 * likelihood);
        let by_row = likelihoods(rows.start as f64 + 0.5 - at.y);
        for (row, by_row) in rows.zip(by_row) {
            let of_row = &mut cells[row * self.width..][..self.width];
            match of_row[columns.start..].first_chunk_mut::<TOGETHER>() {
                // All at once, which the processor does faster than one less.
                Some(cells) if columns.len() == SIDE => raise(cells, &by_column, by_row),
                _ => raise(&mut of_row[columns.clone()], &by_column, by_row),
            }
        }
    }

    /// The maxima of a level and of the same moved by `step` cells to the left, down, and both.
    fn maxima(&self, below: &[u8], step: usize) -> Vec<u8> {
        let (width, height) = (self.width, self.height);
        let mut maxima = below.to_vec();
        for (row, values) in maxima.chunks_exact_mut(width).enumerate() {
            let own = &below[row * width..][..width];
            raise_to(values, &own[step.min(width)..]);
            if row + step < height {
                let other = &below[(row + step) * width..][..width];
                raise_to(values, other);
                raise_to(values, &other[step.min(width)..]);
            }
        }
        maxima
    }

    /// The highest level.
    pub(super) fn top_level(&self) -> usize {
        self.levels.len() - 1
    }

    /// The cell of a point: column and row, which may be outside.
    pub(super) fn cell(&self, point: &Point2) -> [i32; 2] {
        let at = (point - self.corner) / CELL;
        // Faster than to call the function `floor`.
        let floor = |value: f64| {
            let whole = value as i32;
            if f64::from(whole) > value { whole.saturating_sub(1) } else { whole }
        };
        [floor(at.x), floor(at.y)]
    }

    /// Sum of the likelihoods at points.
    pub(super) fn likelihood(&self, points: impl Iterator<Item = Point2>) -> f64 {
        let cells: Vec<[i32; 2]> = points.map(|point| self.cell(&point)).collect();
        f64::from(self.sum(0, &cells, [0, 0])) / 255.0
    }

    /// Sum of the values of a level at cells that are moved by `offset`; 255 for each on a wall.
    pub(super) fn sum(&self, level: usize, cells: &[[i32; 2]], offset: [i32; 2]) -> u32 {
        let values = &self.levels[level];
        let (width, height) = (self.width as i32, self.height as i32);
        // A maximum that begins outside may reach inside.
        let least = if level == 0 { 0 } else { 1 - (1 << level) };
        let mut sum = 0;
        for [column, row] in cells {
            let (column, row) = (column + offset[0], row + offset[1]);
            if column >= least && row >= least && column < width && row < height {
                sum += u32::from(values[row.max(0) as usize * self.width + column.max(0) as usize]);
            }
        }
        sum
    }
}

/// The cells of `count` that a point at a coordinate reaches, both in cells.
fn around(at: f64, count: usize) -> Range<usize> {
    let cell = at.floor() as i64;
    let bounded = |cell: i64| cell.clamp(0, count as i64) as usize;
    bounded(cell.saturating_sub(REACH))..bounded(cell.saturating_add(REACH + 1))
}

/// Raises cells to the products of their values by column and by row, rounded to whole numbers.
fn raise(cells: &mut [u8], by_column: &[f32], by_row: f32) {
    /// Numbers of this size have no digits behind the point.
    const WHOLE: f32 = (1 << 23) as f32;
    for (cell, by_column) in cells.iter_mut().zip(by_column) {
        *cell = (*cell).max((by_column * by_row + WHOLE).to_bits() as u8);
    }
}

/// Raises values to others, one by one.
fn raise_to(values: &mut [u8], others: &[u8]) {
    values.iter_mut().zip(others).for_each(|(value, other)| *value = (*value).max(*other));
}

/// The likelihoods of a point in neighbouring cells along an axis, the first of which is at a distance of so many
/// cells, and 0 beyond. Neighbouring values of a Gaussian have a ratio, which changes by the same factor from each to
/// the next.
fn likelihoods(cells: f64) -> [f32; TOGETHER] {
    const SCALE: f64 = -0.5 * (CELL / DEVIATION) * (CELL / DEVIATION);
    let mut value = (SCALE * cells * cells).exp();
    let mut ratio = (SCALE * (2.0 * cells + 1.0)).exp();
    let change = (2.0 * SCALE).exp();
    let mut likelihoods = [0.0; TOGETHER];
    for likelihood in &mut likelihoods[..SIDE] {
        *likelihood = value as f32;
        value *= ratio;
        ratio *= change;
    }
    likelihoods
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn a_cell_has_the_likelihood_of_its_distance_to_the_nearest_point() {
        // One in the middle, one at the edge, and one outside whose likelihood reaches inside.
        let points = [Point2::new(0.52, 0.49), Point2::new(0.99, 0.3), Point2::new(-0.06, 0.81)];
        let field = LikelihoodField::new(points.into_iter(), &[Point2::origin(), Point2::new(1.0, 1.0)], 1.0);
        for (row, column) in (0..20).flat_map(|row| (0..20).map(move |column| (row, column))) {
            let middle = Point2::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * CELL;
            let distance = points.iter().map(|point| (point - middle).norm()).fold(f64::INFINITY, f64::min);
            let wanted = 255.0 * (-0.5 * (distance / DEVIATION).powi(2)).exp();
            let found = f64::from(field.levels[0][(row * 20 + column) as usize]);
            // Farther away than the reach of a point it is 0.
            assert!((found - wanted).abs() < 0.51 || found == 0.0 && wanted < 10.0, "{column} {row}: {found} {wanted}");
        }
    }

    #[test]
    fn a_level_bounds_all_moves_of_the_cells_below() {
        let wall: Vec<Point2> = (0..40).map(|step| Point2::new(0.1 * f64::from(step), 1.0)).collect();
        let field = LikelihoodField::new(wall.iter().copied(), &[Point2::new(-1.0, -1.0), Point2::new(5.0, 3.0)], 2.0);
        let cells: Vec<[i32; 2]> = wall.iter().map(|point| field.cell(&(point + Vector2::new(0.3, -0.4)))).collect();
        for level in 1..=field.top_level() {
            let side = 1 << level;
            for start in [[-40, -40], [-8, -4], [0, 0], [3, 5]] {
                let bound = field.sum(level, &cells, start);
                for (right, up) in (0..side).flat_map(|right| (0..side).map(move |up| (right, up))) {
                    assert!(field.sum(0, &cells, [start[0] + right, start[1] + up]) <= bound, "{level} {start:?}");
                }
            }
        }
        let on_wall: Vec<[i32; 2]> = wall.iter().map(|point| field.cell(point)).collect();
        assert!(field.sum(0, &on_wall, [0, 0]) > 40 * 200);
    }
}

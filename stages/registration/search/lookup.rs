//! What a raster holds at points of another frame: the innermost loop of the search.

use super::raster::{Content, Raster};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::{Matrix2, Vector2};

impl Raster {
    /// Content at a position given in cells from the corner. Positions outside are clamped to the outermost cells,
    /// which are unknown.
    #[inline]
    pub(super) fn content(&self, place: &Vector2<f64>) -> Content {
        let (column, row) = self.within(place);
        self.cells.get(whole(row) * self.width + whole(column)).copied().unwrap_or_default()
    }

    /// Values of the contents, interpolated between the centres of the cells, at a position given in cells from the
    /// corner. An unknown cell has the value of the first.
    #[inline]
    pub(super) fn interpolated(&self, values: &[f64; 4], place: &Vector2<f64>) -> f64 {
        let (x, y) = self.within(&(place - Vector2::repeat(0.5)));
        let (column, row) = (whole(x), whole(y));
        let (right, up) = (x - column as f64, y - row as f64);
        // Beyond the last column is the first of the next row, which is unknown, too.
        let value = |index: usize| values[self.cells.get(index).copied().unwrap_or_default() as usize];
        let start = row * self.width + column;
        let below = value(start) * (1.0 - right) + value(start + 1) * right;
        let above = value(start + self.width) * (1.0 - right) + value(start + self.width + 1) * right;
        below * (1.0 - up) + above * up
    }

    /// A position clamped to the raster, not beyond the middle of the last cells; what is not a number is at 0.
    #[inline]
    fn within(&self, place: &Vector2<f64>) -> (f64, f64) {
        let clamped = |place: f64, count: usize| {
            let most = count as f64 - 0.5;
            let place = if place > 0.0 { place } else { 0.0 };
            if place < most { place } else { most }
        };
        (clamped(place.x, self.width), clamped(place.y, self.height))
    }

    /// The transform to cells of the raster from another frame, whose pose in that of the raster is given.
    pub(super) fn cell_transform(&self, transform: &Pose2) -> CellTransform {
        CellTransform {
            turn: transform.rotation.to_rotation_matrix().into_inner() / self.cell,
            shift: (transform.translation.vector - self.corner) / self.cell,
        }
    }
}

/// A transform of points of another frame to positions in cells from the corner of a raster.
pub(super) struct CellTransform {
    turn: Matrix2<f64>,
    shift: Vector2<f64>,
}

impl CellTransform {
    /// Position of a point.
    #[inline]
    pub(super) fn place(&self, point: &Point2) -> Vector2<f64> {
        self.turned(&point.coords) + self.shift
    }

    /// A direction, in cells.
    #[inline]
    pub(super) fn turned(&self, direction: &Vector2<f64>) -> Vector2<f64> {
        self.turn * direction
    }
}

/// Integer part of a value from 0 to 2^31; that of an integer may be one less.
///
/// Added to 1.5 * 2^52, a number is rounded to its lowest bits. That takes a fraction of the time of a cast, which
/// checks for what is out of range, and the compiler can do it for two numbers at once.
#[inline]
fn whole(value: f64) -> usize {
    const ROUND: f64 = 1.5 * (1_u64 << 52) as f64;
    (value - 0.5 + ROUND).to_bits() as u32 as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_outside_or_not_a_number_is_unknown() {
        assert_eq!([0.0, 0.2, 0.999, 1.5].map(whole), [0, 0, 0, 1]);
        for side in 0..9 {
            // Walls up to a rim of one cell.
            let is_inside = |along: usize| along > 0 && along + 1 < side;
            let content = |index: usize| match is_inside(index % side) && is_inside(index / side) {
                true => Content::Wall,
                false => Content::Unknown,
            };
            let cells = (0..side * side).map(content).collect();
            let raster = Raster { width: side, height: side, cells, ..Raster::default() };
            let far = [-1e300, -0.1, side as f64, 1e5, 1e300, f64::INFINITY, f64::NAN];
            for (x, y) in far.into_iter().flat_map(|far| [(far, 1.5), (1.5, far), (far, far)]) {
                let place = Vector2::new(x, y);
                assert_eq!(raster.content(&place), Content::Unknown, "{place}");
                let interpolated = raster.interpolated(&[0.0, 1.0, 1.0, 1.0], &place);
                assert!(interpolated == 0.0 || (-0.5..=side as f64 + 0.5).contains(&x.max(y)), "{place}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_integer_part_is_the_floor(value in 0.0..1e9) {
            prop_assert_eq!(whole(value), value.floor() as usize);
        }
    }
}

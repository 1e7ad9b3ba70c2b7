//! Indices of the cells of one lattice along a row of another.

use nalgebra::Vector2;

/// Bits after the binary point: a row of ten thousand cells ends within a hundred-thousandth of a cell.
const FRACTION: u32 = 32;

/// The cells of another lattice, by their row-by-row indices, in which the cells of a row are.
///
/// It uses fixed-point numbers, whose whole part costs one shift: that takes a fraction of the time of rounding each
/// position.
pub(super) struct Walk {
    place: (i64, i64),
    step: (i64, i64),
    width: i64,
}

impl Walk {
    /// From `start` in steps of `step`, both in cells of a lattice with rows of `width` cells.
    pub(super) fn new(start: &Vector2<f64>, step: &Vector2<f64>, width: usize) -> Self {
        let fixed = |value: f64| (value * (1_u64 << FRACTION) as f64) as i64;
        Self { place: (fixed(start.x), fixed(start.y)), step: (fixed(step.x), fixed(step.y)), width: width as i64 }
    }
}

impl Iterator for Walk {
    /// Beyond all cells for positions before the first row.
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        let (x, y) = self.place;
        self.place = (x.wrapping_add(self.step.0), y.wrapping_add(self.step.1));
        Some((y >> FRACTION).wrapping_mul(self.width).wrapping_add(x >> FRACTION) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_walk_visits_the_cells_at_its_positions(
            x in 0.0..5000.0, y in 0.0..5000.0, angle in 0.0..1.57, count in 1usize..10_000,
        ) {
            let (start, step) = (Vector2::new(x, y), 0.7 * Vector2::new(f64::cos(angle), f64::sin(angle)));
            for (number, index) in Walk::new(&start, &step, 20_000).take(count).enumerate() {
                let place = start + step * number as f64;
                let is_beside_border = |along: f64| (along - along.round()).abs() < 1e-5;
                let expected = place.y as usize * 20_000 + place.x as usize;
                prop_assert!(index == expected || is_beside_border(place.x) || is_beside_border(place.y));
            }
        }
    }
}

//! The acceptance index omega of two aligned maps: the share of the cells on which they agree, of those that both
//! know.
//!
//! It is the criterion of the published mergers that use the maps only: Birk and Carpin, "Merging occupancy grid maps
//! from multiple robots", Proceedings of the IEEE 94 (2006), and Carpin, "Fast and accurate map merging for
//! multi-robot systems", Autonomous Robots 25 (2008). Free space, most of a map, agrees with free space at any pose,
//! and two maps that hardly overlap agree on the little they share: a high index alone is no proof.

use gridweave_stages::shared::geometry::{Grid, Pose2, UNKNOWN, is_free, is_known, is_occupied};
use nalgebra::Vector2;
use rayon::prelude::*;
use std::iter::Sum;

/// Counts of the cells of map b whose centres are on cells of map a, where both maps are either free or occupied.
///
/// Cells that are known, but neither free nor occupied, are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AcceptanceIndex {
    /// Cells that are free in both maps, or occupied in both.
    pub agree: u64,
    /// Cells that are free in one map and occupied in the other.
    pub disagree: u64,
}

impl AcceptanceIndex {
    /// Counts the cells of map b, transformed to map a by `T_a_b`.
    ///
    /// Every cell of b is looked up in a, so a finer map is better given as b. None are counted if the transform is
    /// not finite.
    pub fn new(a: &Grid<'_>, b: &Grid<'_>, transform_a_b: &Pose2) -> Self {
        let (from, to) = (&b.geometry, &a.geometry);
        // From cells of b to cells of a.
        let transform = to.origin.inverse() * transform_a_b * from.origin;
        let turn = transform.rotation.to_rotation_matrix().into_inner() * (from.resolution / to.resolution);
        let shift = transform.translation.vector / to.resolution;
        let step = turn.column(0);
        let count_row = |(row, cells): (usize, &[i8])| {
            let first = turn * Vector2::new(0.5, row as f64 + 0.5) + shift;
            let known = cells.iter().enumerate().filter(|(_, value)| is_known(**value));
            let counts = known.map(|(column, value)| {
                let place = first + step * column as f64;
                Self::of_cells(value_in_cells(a, &place), *value)
            });
            counts.sum::<Self>()
        };
        b.cells.par_chunks(from.width.max(1)).enumerate().map(count_row).sum()
    }

    /// `agree / (agree + disagree)`, 0 to 1; 0 where the maps have no cell in common.
    pub fn omega(&self) -> f64 {
        match self.known_in_both() {
            0 => 0.0,
            known => self.agree as f64 / known as f64,
        }
    }

    /// Number of counted cells.
    pub fn known_in_both(&self) -> u64 {
        self.agree + self.disagree
    }

    fn of_cells(a: i8, b: i8) -> Self {
        let agree = is_free(a) && is_free(b) || is_occupied(a) && is_occupied(b);
        let disagree = is_free(a) && is_occupied(b) || is_occupied(a) && is_free(b);
        Self { agree: agree.into(), disagree: disagree.into() }
    }
}

impl Sum for AcceptanceIndex {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |sum, count| Self {
            agree: sum.agree + count.agree,
            disagree: sum.disagree + count.disagree,
        })
    }
}

/// Value of the cell at a position in cells; unknown outside of the grid.
fn value_in_cells(grid: &Grid<'_>, place: &Vector2<f64>) -> i8 {
    let (width, height) = (grid.geometry.width, grid.geometry.height);
    let on_it = place.x >= 0.0 && place.y >= 0.0 && place.x < width as f64 && place.y < height as f64;
    if on_it { grid.cells[place.y as usize * width + place.x as usize] } else { UNKNOWN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_stages::shared::geometry::{Cell, GridGeometry, pose};
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn grid(width: usize, resolution: f64, origin: Pose2, cells: &[i8]) -> Grid<'_> {
        let height = cells.len().checked_div(width).unwrap_or(0);
        Grid::new(GridGeometry { width, height, resolution, origin }, cells).unwrap()
    }

    fn index(agree: u64, disagree: u64) -> AcceptanceIndex {
        AcceptanceIndex { agree, disagree }
    }

    #[test]
    fn only_cells_that_both_maps_know_are_counted() {
        let cells_a = [0, 0, 0, 0, 100, 100, 100, 100, 50, -1];
        let cells_b = [0, 100, 50, -1, 0, 100, 50, -1, 0, 0];
        let (a, b) = (grid(10, 0.05, Pose2::identity(), &cells_a), grid(10, 0.05, Pose2::identity(), &cells_b));
        let counted = AcceptanceIndex::new(&a, &b, &Pose2::identity());
        assert_eq!((counted, counted.known_in_both(), counted.omega()), (index(2, 2), 4, 0.5));
    }

    #[test]
    fn the_transform_and_both_origins_are_honoured() {
        // Map b is map a, turned left by a quarter turn in a grid that is itself turned.
        let cells_a = [0, 100, 0, 0, 0, 100];
        let cells_b = [0, 0, 0, 100, 100, 0];
        let a = grid(3, 0.1, pose(5.0, -2.0, 0.3), &cells_a);
        let b = grid(2, 0.1, pose(-7.0, 1.0, 1.1), &cells_b);
        // The lower left corner of a is the lower right one of b.
        let on_it = a.geometry.origin * pose(0.0, 0.2, -FRAC_PI_2) * b.geometry.origin.inverse();
        assert_eq!(AcceptanceIndex::new(&a, &b, &on_it), index(6, 0));
        let opposite = a.geometry.origin * pose(0.3, 0.0, FRAC_PI_2) * b.geometry.origin.inverse();
        assert_eq!(AcceptanceIndex::new(&a, &b, &opposite), index(2, 4));
    }

    #[test]
    fn a_finer_map_counts_by_its_own_cells() {
        let (coarse, fine) = ([0, 100], [0, 0, 100, 100, 0, 100, 100, 100]);
        let (a, b) = (grid(2, 0.1, Pose2::identity(), &coarse), grid(4, 0.05, Pose2::identity(), &fine));
        assert_eq!(AcceptanceIndex::new(&a, &b, &Pose2::identity()), index(7, 1));
        assert_eq!(AcceptanceIndex::new(&b, &a, &Pose2::identity()).known_in_both(), 2);
    }

    #[test]
    fn maps_with_nothing_in_common_have_an_index_of_zero() {
        let (free, unknown) = ([0; 12], [UNKNOWN; 12]);
        let a = grid(4, 0.05, Pose2::identity(), &free);
        let others = [grid(4, 0.05, Pose2::identity(), &unknown), grid(0, 0.05, Pose2::identity(), &[])];
        for other in &others {
            for counted in [
                AcceptanceIndex::new(&a, other, &Pose2::identity()),
                AcceptanceIndex::new(other, &a, &Pose2::identity()),
            ] {
                assert_eq!((counted, counted.omega()), (index(0, 0), 0.0));
            }
        }
        for far in [pose(1e300, 0.0, 0.0), pose(f64::NAN, 0.0, 0.0), pose(0.0, 0.0, f64::INFINITY), pose(3.0, 0.0, 0.0)]
        {
            assert_eq!(AcceptanceIndex::new(&a, &a, &far), index(0, 0), "{far:?}");
        }
    }

    proptest! {
        #[test]
        fn a_map_agrees_with_itself_whatever_its_frame(
            x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0, cells in prop::collection::vec(-1i8..=100, 60),
        ) {
            let a = grid(10, 0.05, pose(x, y, yaw), &cells);
            let sides = cells.iter().filter(|value| is_free(**value) || is_occupied(**value)).count() as u64;
            prop_assert_eq!(AcceptanceIndex::new(&a, &a, &Pose2::identity()), index(sides, 0));
        }

        #[test]
        fn it_counts_what_a_look_at_every_cell_counts(
            x in -0.6..0.6, y in -0.6..0.6, yaw in -4.0..4.0,
            cells_a in prop::collection::vec(-1i8..=100, 60), cells_b in prop::collection::vec(-1i8..=100, 77),
        ) {
            let a = grid(10, 0.05, pose(-0.25, -0.2, 0.2), &cells_a);
            let b = grid(7, 0.07, pose(0.1, 0.3, -0.4), &cells_b);
            let transform = pose(x, y, yaw);
            let all = (0..11).flat_map(|row| (0..7).map(move |column| Cell { column, row }));
            let expected: AcceptanceIndex = all
                .map(|cell| {
                    let there = a.value_at(&(transform * b.geometry.centre(cell)));
                    AcceptanceIndex::of_cells(there, b.value(cell))
                })
                .sum();
            prop_assert_eq!(AcceptanceIndex::new(&a, &b, &transform), expected);
        }
    }
}

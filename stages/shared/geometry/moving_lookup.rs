//! Nearest neighbour of a point that moves little from one query to the next, as in the iterations of ICP.

use super::point_index::{Neighbour, PointIndex};
use super::pose::Point2;

/// How much farther than the nearest another neighbour is looked for, metres. Half of it is what the point may move
/// before it is looked up again: the last steps of an iteration are shorter, and more would take longer to look through.
const BEYOND: f64 = 0.02;
/// What rounding may take from a distance, metres.
const ROUNDING: f64 = 1e-9;

/// The last lookup of a point, which holds while the point stays near (Nüchter, Lingemann and Hertzberg 2007, "Cached
/// k-d tree search for ICP algorithms", but for that the neighbour found is always the nearest).
#[derive(Clone, Copy, Debug)]
pub struct MovingLookup {
    /// Where the point was.
    place: Point2,
    /// Index of the nearest; beyond all if there was none.
    nearest: usize,
    /// How far the point may move from there, metres, so that the nearest stays the nearest.
    slack: f64,
    /// The radius within which there was none, metres.
    empty: f64,
}

impl Default for MovingLookup {
    fn default() -> Self {
        Self { place: Point2::origin(), nearest: usize::MAX, slack: 0.0, empty: 0.0 }
    }
}

impl MovingLookup {
    /// The neighbour nearest to `point` within `radius`, which is that of [`PointIndex::nearest`]. All lookups are in
    /// the same index. `near` is the index of a point that may be near, for the first of them, as that of the point
    /// before on a wall is; an index of no point is ignored.
    pub fn nearest(&mut self, index: &PointIndex, point: &Point2, radius: f64, near: usize) -> Option<Neighbour> {
        let moved = (point - self.place).norm() + ROUNDING;
        if moved < self.slack {
            let squared_distance = (index.points()[self.nearest] - point).norm_squared();
            return (squared_distance <= radius * radius)
                .then_some(Neighbour { index: self.nearest, squared_distance });
        }
        if moved + radius < self.empty {
            return None;
        }
        let wider = radius + BEYOND;
        let near = if self.nearest == usize::MAX { near } else { self.nearest };
        let found = index.two_nearest(point, wider, near, BEYOND);
        let nearest = found.nearest();
        self.place = *point;
        match nearest {
            Some(nearest) => {
                let distance = nearest.squared_distance.sqrt();
                // Others were not looked at if they are farther than this.
                let second = found.second.sqrt().min(distance + BEYOND);
                (self.nearest, self.slack, self.empty) = (nearest.index, 0.5 * (second - distance), 0.0);
            }
            None => (self.slack, self.empty) = (0.0, wider),
        }
        nearest.filter(|nearest| nearest.squared_distance <= radius * radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_point_on_its_way_has_the_neighbours_that_it_has_alone(
            points in prop::collection::vec((-1.0..1.0, -1.0..1.0), 0..80),
            steps in prop::collection::vec((-0.02..0.02, -0.02..0.02, 0.05..0.5), 1..30),
            x in -1.2..1.2, y in -1.2..1.2,
        ) {
            let points: Vec<Point2> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let (index, _) = PointIndex::new(&points, 0.1);
            let (mut lookup, mut at) = (MovingLookup::default(), Point2::new(x, y));
            for (step, (x, y, radius)) in steps.into_iter().enumerate() {
                // Every other step is short, as those of ICP become.
                let share = if step % 2 == 0 { 1.0 } else { 0.05 };
                at += nalgebra::Vector2::new(x, y) * share;
                prop_assert_eq!(lookup.nearest(&index, &at, radius, step), index.nearest(&at, radius));
            }
        }
    }

    #[test]
    fn of_two_neighbours_at_equal_distance_it_is_the_first() {
        let points = [Point2::new(0.1, 0.0), Point2::new(-0.1, 0.0), Point2::new(0.1, 0.0)];
        let (index, _) = PointIndex::new(&points, 0.1);
        let mut lookup = MovingLookup::default();
        for x in [0.0, 1e-12, -1e-12, 0.0] {
            let at = Point2::new(x, 0.0);
            assert_eq!(lookup.nearest(&index, &at, 0.2, usize::MAX), index.nearest(&at, 0.2));
        }
    }

    #[test]
    fn a_place_that_is_no_number_has_no_neighbour() {
        let (index, _) = PointIndex::new(&[Point2::origin()], 0.1);
        let mut lookup = MovingLookup::default();
        assert!(lookup.nearest(&index, &Point2::new(f64::NAN, 0.0), 0.2, 0).is_none());
        assert!(lookup.nearest(&index, &Point2::new(0.05, 0.0), 0.2, 0).is_some());
    }
}

//! Points in square buckets: which of them lie near a line, and near each other.

use super::line::Line;
use crate::geometry::Point2;
use rand::{Rng, RngExt};
use std::ops::Range;

/// How often a neighbour is drawn before the search for one is given up.
const DRAWS: usize = 8;

/// Points of a plane that begins at (0, 0), sorted into square buckets.
///
/// A point is named by its place in [`points`](Self::points), which is sorted by bucket.
#[derive(Clone, Debug)]
pub(super) struct PointIndex {
    side: f64,
    columns: usize,
    rows: usize,
    /// For every bucket, row by row, where its points begin; one more at the end.
    starts: Vec<usize>,
    points: Vec<Point2>,
}

impl PointIndex {
    /// Sorts the points of a plane of `width` x `height` into buckets of the given side, which is 1 or more.
    pub(super) fn new(points: &[Point2], width: usize, height: usize, side: f64) -> Self {
        let side = if side >= 1.0 { side } else { 1.0 };
        let buckets = |cells: usize| ((cells as f64 / side).ceil() as usize).max(1);
        let (columns, rows) = (buckets(width), buckets(height));
        let place = |value: f64, count: usize| ((value / side) as usize).min(count - 1);
        let bucket = |point: &Point2| place(point.y, rows) * columns + place(point.x, columns);

        let mut starts = vec![0; columns * rows + 1];
        for point in points {
            starts[bucket(point) + 1] += 1;
        }
        for index in 1..starts.len() {
            starts[index] += starts[index - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![Point2::origin(); points.len()];
        for point in points {
            let place = &mut next[bucket(point)];
            sorted[*place] = *point;
            *place += 1;
        }
        Self { side, columns, rows, starts, points: sorted }
    }

    /// The points, sorted by bucket.
    pub(super) fn points(&self) -> &[Point2] {
        &self.points
    }

    /// Appends to `found` the points within `reach` of the line for which `wanted` holds.
    ///
    /// The search begins at `from`, a point near the line, and goes along the line both ways, each until a stretch of
    /// `max_gap` or more without such points; so what lies beyond a larger gap may be missing, and nothing else.
    pub(super) fn near_line(
        &self,
        line: &Line,
        from: &Point2,
        reach: f64,
        max_gap: f64,
        wanted: impl Fn(usize) -> bool,
        found: &mut Vec<usize>,
    ) {
        let direction = line.direction();
        // u is the axis that the line runs along, v the one across.
        let steep = direction.y.abs() > direction.x.abs();
        let (point, from) = (line.point(), if steep { from.y } else { from.x });
        let (u, v, slope) = match steep {
            true => (point.y, point.x, direction.x / direction.y),
            false => (point.x, point.y, direction.y / direction.x),
        };
        let (u_count, v_count) = if steep { (self.rows, self.columns) } else { (self.columns, self.rows) };
        let margin = reach * 1.0_f64.hypot(slope);

        let mut scan = |u_bucket: usize| -> bool {
            let first = v + (u_bucket as f64 * self.side - u) * slope;
            let last = first + self.side * slope;
            let (low, high) = (first.min(last) - margin, first.max(last) + margin);
            if !(high >= 0.0 && low < v_count as f64 * self.side) {
                return false;
            }
            let before = found.len();
            let v_last = ((high / self.side) as usize).min(v_count - 1);
            for v_bucket in (low / self.side) as usize..=v_last {
                let bucket = match steep {
                    true => u_bucket * self.columns + v_bucket,
                    false => v_bucket * self.columns + u_bucket,
                };
                for id in self.starts[bucket]..self.starts[bucket + 1] {
                    if line.distance(&self.points[id]) <= reach && wanted(id) {
                        found.push(id);
                    }
                }
            }
            found.len() > before
        };

        let middle = ((from / self.side) as usize).min(u_count - 1);
        let empty_limit = max_gap / self.side;
        let mut walk = |buckets: &mut dyn Iterator<Item = usize>| {
            let mut empty = 0.0;
            for bucket in buckets {
                empty = if scan(bucket) { 0.0 } else { empty + 1.0 };
                if empty > empty_limit {
                    break;
                }
            }
        };
        walk(&mut (middle..u_count));
        walk(&mut (0..middle).rev());
    }

    /// Draws a point at `min_distance` to `max_distance` from the point `id` for which `wanted` holds. `None` if a few
    /// draws find none. `max_distance` is at most the side of a bucket.
    pub(super) fn draw_neighbour(
        &self,
        id: usize,
        min_distance: f64,
        max_distance: f64,
        wanted: impl Fn(usize) -> bool,
        random: &mut impl Rng,
    ) -> Option<usize> {
        let point = self.points[id];
        let bands = self.bands_around(&point);
        let count: usize = bands.iter().map(ExactSizeIterator::len).sum();
        if count == 0 {
            return None;
        }
        (0..DRAWS).find_map(|_| {
            let mut drawn = random.random_range(0..count);
            let band = bands.iter().find(|band| {
                let inside = drawn < band.len();
                drawn -= if inside { 0 } else { band.len() };
                inside
            })?;
            let other = band.start + drawn;
            let distance = (self.points[other] - point).norm();
            (distance >= min_distance && distance <= max_distance && wanted(other)).then_some(other)
        })
    }

    /// The points of the three by three buckets round a point: three runs, since a row's buckets follow each other.
    fn bands_around(&self, point: &Point2) -> [Range<usize>; 3] {
        let column = ((point.x / self.side) as usize).min(self.columns - 1);
        let row = ((point.y / self.side) as usize).min(self.rows - 1);
        let (left, right) = (column.saturating_sub(1), (column + 1).min(self.columns - 1));
        [row.checked_sub(1), Some(row), Some(row + 1)].map(|row| match row {
            Some(row) if row < self.rows => {
                self.starts[row * self.columns + left]..self.starts[row * self.columns + right + 1]
            }
            _ => 0..0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn points() -> impl Strategy<Value = Vec<Point2>> {
        prop::collection::vec((0.0..50.0, 0.0..30.0).prop_map(|(x, y)| Point2::new(x, y)), 0..200)
    }

    proptest! {
        #[test]
        fn the_points_near_a_line_are_those_that_a_full_search_finds(
            points in points(), side in 1.0..20.0, reach in 0.1..5.0,
            a in (-20.0..70.0, -20.0..50.0), b in (-20.0..70.0, -20.0..50.0),
        ) {
            let index = PointIndex::new(&points, 50, 30, side);
            let (a, b) = (Point2::new(a.0, a.1), Point2::new(b.0, b.1));
            if let Some(line) = Line::through(&a, &b) {
                let mut found = Vec::new();
                index.near_line(&line, &a, reach, f64::INFINITY, |id| id % 3 != 0, &mut found);
                found.sort_unstable();
                let expected: Vec<usize> = (0..index.points().len())
                    .filter(|&id| id % 3 != 0 && line.distance(&index.points()[id]) <= reach)
                    .collect();
                prop_assert_eq!(found, expected);
            }
        }

        #[test]
        fn a_drawn_neighbour_keeps_its_distance(points in points(), seed in 0u64..99) {
            let index = PointIndex::new(&points, 50, 30, 8.0);
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            for id in 0..index.points().len() {
                if let Some(other) = index.draw_neighbour(id, 2.0, 8.0, |id| id % 2 == 0, &mut random) {
                    let distance = (index.points()[id] - index.points()[other]).norm();
                    prop_assert!((2.0..=8.0).contains(&distance) && other % 2 == 0);
                }
            }
        }
    }

    #[test]
    fn the_search_ends_at_a_gap() {
        let points: Vec<Point2> = [0, 1, 2, 3, 4, 40, 41].map(|x| Point2::new(f64::from(x) + 0.5, 0.5)).to_vec();
        let index = PointIndex::new(&points, 50, 30, 4.0);
        let line = Line::through(&points[0], &points[1]).unwrap();
        let mut found = Vec::new();
        index.near_line(&line, &points[0], 1.0, 10.0, |_| true, &mut found);
        assert_eq!(found.len(), 5);
    }

    #[test]
    fn an_empty_plane_has_no_points() {
        let index = PointIndex::new(&[], 0, 0, f64::NAN);
        let mut found = Vec::new();
        let line = Line::through(&Point2::new(0.0, 0.0), &Point2::new(1.0, 1.0)).unwrap();
        index.near_line(&line, &Point2::new(9.0, 9.0), 1.0, 1.0, |_| true, &mut found);
        assert!(found.is_empty());
    }
}

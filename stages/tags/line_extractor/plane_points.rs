//! Points in square buckets, to find those near a line and near each other.

use super::line::{Line, Stretch};
use crate::shared::geometry::{Buckets, Point2, PointIndex};
use nalgebra::Vector2;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Number of draws before the search for a neighbour is given up.
const DRAWS: usize = 8;
/// Most rows of buckets within four sides of a point, both ways.
const BANDS: usize = 9;

/// Points of a plane that begins at (0, 0), sorted into square buckets.
///
/// A point is identified by its index in [`points`](Self::points), which is sorted by bucket.
#[derive(Clone, Debug)]
pub(super) struct PlanePoints {
    /// Extent of the plane.
    size: Vector2<f64>,
    sorted: PointIndex,
}

impl PlanePoints {
    /// Sorts the points of a plane of `width` x `height` into buckets of the given side, which is 1 or more.
    pub(super) fn new(points: &[Point2], width: usize, height: usize, side: f64) -> Self {
        let side = if side >= 1.0 { side } else { 1.0 };
        let count = |cells: usize| ((cells as f64 / side).ceil() as usize).max(1);
        let buckets = Buckets { corner: Point2::origin(), side, columns: count(width), rows: count(height) };
        let sorted = PointIndex::in_buckets(points, buckets, |_, _| ());
        Self { size: Vector2::new(width as f64, height as f64), sorted }
    }

    /// Extent of the plane, which begins at (0, 0).
    pub(super) fn size(&self) -> Vector2<f64> {
        self.size
    }

    /// The points, sorted by bucket.
    pub(super) fn points(&self) -> &[Point2] {
        self.sorted.points()
    }

    /// Calls `visit` with the indices of points within `reach` of the line; it returns whether they are wanted.
    ///
    /// The search begins at `from`, a point near the line, and goes along the line both ways, each until a stretch of
    /// `max_gap` or more without wanted points; so only points beyond a larger gap may be missing.
    pub(super) fn near_line(
        &self,
        line: &Line,
        from: &Point2,
        reach: f64,
        max_gap: f64,
        mut visit: impl FnMut(usize) -> bool,
    ) {
        let strip = Strip::new(&self.sorted, line, reach);
        let middle = strip.slice(from);
        let most_empty = max_gap / self.sorted.buckets().side;
        let mut empty = 0.0;
        for slice in middle..strip.slices {
            empty = if strip.visit(slice, &mut visit) { 0.0 } else { empty + 1.0 };
            if empty > most_empty {
                break;
            }
        }
        let mut empty = 0.0;
        for slice in (0..middle).rev() {
            empty = if strip.visit(slice, &mut visit) { 0.0 } else { empty + 1.0 };
            if empty > most_empty {
                break;
            }
        }
    }

    /// Calls `visit` with the indices of all points within `reach` of the line of a stretch that are along the
    /// stretch, and of some beyond its ends.
    pub(super) fn near_stretch(&self, stretch: &Stretch, reach: f64, mut visit: impl FnMut(usize)) {
        let strip = Strip::new(&self.sorted, &stretch.line, reach);
        let beyond = |along: f64| strip.slice(&stretch.line.at(along));
        let (a, b) = (beyond(stretch.start - reach), beyond(stretch.end + reach));
        for slice in a.min(b)..=a.max(b) {
            strip.visit(slice, &mut |id| {
                visit(id);
                true
            });
        }
    }

    /// Draws a point at `min_distance` to `max_distance` from the point `id` for which `wanted` holds. `None` if a
    /// few draws find none. `max_distance` is at most four times the side of a bucket.
    pub(super) fn draw_neighbour(
        &self,
        id: usize,
        min_distance: f64,
        max_distance: f64,
        wanted: impl Fn(usize) -> bool,
        random: &mut impl Rng,
    ) -> Option<usize> {
        let points = self.points();
        let point = points[id];
        let bands = self.bands_around(&point, max_distance);
        let count: usize = bands.iter().map(ExactSizeIterator::len).sum();
        if count == 0 {
            return None;
        }
        let (least, most) = (min_distance * min_distance, max_distance * max_distance);
        (0..DRAWS).find_map(|_| {
            let mut drawn = random.random_range(0..count);
            let band = bands.iter().find(|band| {
                let inside = drawn < band.len();
                drawn -= if inside { 0 } else { band.len() };
                inside
            })?;
            let other = band.start + drawn;
            let distance = (points[other] - point).norm_squared();
            (distance >= least && distance <= most && wanted(other)).then_some(other)
        })
    }

    /// The points of the buckets within `distance` of a point: a run for each row, since a row's buckets are
    /// contiguous.
    fn bands_around(&self, point: &Point2, distance: f64) -> [Range<usize>; BANDS] {
        let buckets = self.sorted.buckets();
        let (left, right) = (buckets.column(point.x - distance), buckets.column(point.x + distance));
        let (first, last) = (buckets.row(point.y - distance), buckets.row(point.y + distance));
        std::array::from_fn(|index| match first + index {
            row if row <= last => self.sorted.run(row, left, right),
            _ => 0..0,
        })
    }
}

/// The buckets that a strip of the plane intersects, cut into slices across its longer axis.
struct Strip<'a> {
    index: &'a PointIndex,
    /// Whether the strip runs along y rather than x.
    is_steep: bool,
    /// Where the line crosses the lower border of the first slice, and its offset per slice.
    start: f64,
    step: f64,
    /// Half the width of the strip across its longer axis.
    margin: f64,
    /// The line in its normal form, and half the width of the strip.
    normal: [f64; 3],
    reach: f64,
    /// The number of slices and of buckets of each.
    slices: usize,
    across: usize,
}

impl<'a> Strip<'a> {
    fn new(index: &'a PointIndex, line: &Line, reach: f64) -> Self {
        let Buckets { side, columns, rows, .. } = *index.buckets();
        let (point, direction) = (line.point(), line.direction());
        let is_steep = direction.y.abs() > direction.x.abs();
        let (u, v, slope) = match is_steep {
            true => (point.y, point.x, direction.x / direction.y),
            false => (point.x, point.y, direction.y / direction.x),
        };
        let (slices, across) = if is_steep { (rows, columns) } else { (columns, rows) };
        Self {
            index,
            is_steep,
            start: v - u * slope,
            step: side * slope,
            margin: reach * 1.0_f64.hypot(slope),
            normal: [-direction.y, direction.x, direction.y * point.x - direction.x * point.y],
            reach,
            slices,
            across,
        }
    }

    /// The slice of a point; the nearest one for points outside.
    fn slice(&self, point: &Point2) -> usize {
        let place = if self.is_steep { point.y } else { point.x };
        ((place / self.index.buckets().side) as usize).min(self.slices - 1)
    }

    /// Calls `visit` with the points of a slice. Returns whether one was wanted.
    fn visit(&self, slice: usize, visit: &mut impl FnMut(usize) -> bool) -> bool {
        let (first, last) = (self.start + slice as f64 * self.step, self.start + (slice + 1) as f64 * self.step);
        let (low, high) = (first.min(last) - self.margin, first.max(last) + self.margin);
        let side = self.index.buckets().side;
        if !(high >= 0.0 && low < self.across as f64 * side) {
            return false;
        }
        let (low, high) = ((low / side) as usize, ((high / side) as usize).min(self.across - 1));
        if self.is_steep {
            return self.visit_run(self.index.run(slice, low, high), visit);
        }
        let mut is_wanted = false;
        for row in low..=high {
            is_wanted |= self.visit_run(self.index.run(row, slice, slice), visit);
        }
        is_wanted
    }

    fn visit_run(&self, run: Range<usize>, visit: &mut impl FnMut(usize) -> bool) -> bool {
        let [x, y, offset] = self.normal;
        let mut is_wanted = false;
        for (id, point) in run.clone().zip(&self.index.points()[run]) {
            if (x * point.x + y * point.y + offset).abs() <= self.reach {
                is_wanted |= visit(id);
            }
        }
        is_wanted
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
            let index = PlanePoints::new(&points, 50, 30, side);
            let (a, b) = (Point2::new(a.0, a.1), Point2::new(b.0, b.1));
            if let Some(line) = Line::through(&a, &b) {
                let mut found = Vec::new();
                index.near_line(&line, &a, reach, f64::INFINITY, |id| {
                    if id % 3 != 0 {
                        found.push(id);
                    }
                    id % 3 != 0
                });
                found.sort_unstable();
                let expected: Vec<usize> = (0..index.points().len())
                    .filter(|&id| id % 3 != 0 && line.distance(&index.points()[id]) <= reach)
                    .collect();
                prop_assert_eq!(found, expected);
            }
        }

        #[test]
        fn all_points_near_a_stretch_are_found(
            points in points(), side in 1.0..20.0, reach in 0.1..5.0,
            a in (-20.0..70.0, -20.0..50.0), b in (-20.0..70.0, -20.0..50.0),
        ) {
            let index = PlanePoints::new(&points, 50, 30, side);
            let (a, b) = (Point2::new(a.0, a.1), Point2::new(b.0, b.1));
            if let Some(line) = Line::through(&a, &b) {
                let (start, end) = (0.0, (b - a).norm());
                let inside = |id: usize| (start..=end).contains(&line.along(&index.points()[id]));
                let mut found = Vec::new();
                index.near_stretch(&Stretch { line, start, end }, reach, |id| found.push(id));
                prop_assert!(found.iter().all(|&id| line.distance(&index.points()[id]) <= reach + 1e-9));
                found.retain(|&id| inside(id));
                found.sort_unstable();
                let expected: Vec<usize> = (0..index.points().len())
                    .filter(|&id| inside(id) && line.distance(&index.points()[id]) <= reach)
                    .collect();
                prop_assert_eq!(found, expected);
            }
        }

        #[test]
        fn a_drawn_neighbour_keeps_its_distance(points in points(), seed in 0u64..99, side in 2.0..9.0) {
            let index = PlanePoints::new(&points, 50, 30, side);
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
        let index = PlanePoints::new(&points, 50, 30, 4.0);
        let line = Line::through(&points[0], &points[1]).unwrap();
        let mut found = Vec::new();
        index.near_line(&line, &points[0], 1.0, 10.0, |id| {
            found.push(id);
            true
        });
        assert_eq!(found.len(), 5);
    }

    #[test]
    fn an_empty_plane_has_no_points() {
        let index = PlanePoints::new(&[], 0, 0, f64::NAN);
        let line = Line::through(&Point2::new(0.0, 0.0), &Point2::new(1.0, 1.0)).unwrap();
        index.near_line(&line, &Point2::new(9.0, 9.0), 1.0, 1.0, |_| panic!("a point"));
        index.near_stretch(&Stretch { line, start: -5.0, end: 5.0 }, 1.0, |_| panic!("a point"));
    }
}

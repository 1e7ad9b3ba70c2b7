//! Nearest neighbours among points in the plane about as dense as the cells of a map.
//!
//! The points are sorted into square buckets, so that a query reads a few short runs of memory. For a small radius
//! and points along walls this takes a fraction of the time of a k-d tree, and ties are broken by the order of the
//! points, so that no result depends on the machine's vector instructions.

use super::Point2;
use std::ops::Range;

/// A division of a rectangle of the plane into square buckets.
#[derive(Clone, Copy, Debug)]
pub struct Buckets {
    /// The corner of least x and y.
    pub corner: Point2,
    /// The side of a bucket.
    pub side: f64,
    /// Buckets along x, at least one.
    pub columns: usize,
    /// Buckets along y, at least one.
    pub rows: usize,
}

impl Buckets {
    /// Buckets of the given side that contain all of the points, which are finite; of a wider side where they are far
    /// apart, so that few points need few buckets.
    fn around(points: &[Point2], mut side: f64) -> Self {
        let Some(first) = points.first() else { return Self { corner: Point2::origin(), side, columns: 1, rows: 1 } };
        let (low, high) = points.iter().fold((*first, *first), |(low, high), point| (low.inf(point), high.sup(point)));
        let most = 1024.0 + 64.0 * points.len() as f64;
        while ((high.x - low.x) / side + 1.0) * ((high.y - low.y) / side + 1.0) > most && side < f64::MAX / 4.0 {
            side *= 2.0;
        }
        let count = |low: f64, high: f64| ((high - low) / side) as usize + 1;
        Self { corner: low, side, columns: count(low.x, high.x), rows: count(low.y, high.y) }
    }

    /// The column of buckets that contains `x`; the nearest one for what is outside.
    pub fn column(&self, x: f64) -> usize {
        (((x - self.corner.x) / self.side).max(0.0) as usize).min(self.columns - 1)
    }

    /// The row of buckets that contains `y`; the nearest one for what is outside.
    pub fn row(&self, y: f64) -> usize {
        (((y - self.corner.y) / self.side).max(0.0) as usize).min(self.rows - 1)
    }
}

/// Points in buckets.
#[derive(Clone, Debug)]
pub struct PointIndex {
    buckets: Buckets,
    /// Start of each bucket in `points`, row of buckets by row, and the end of the last.
    starts: Vec<u32>,
    /// The points, bucket by bucket.
    points: Vec<Point2>,
}

/// The nearest neighbour of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its index in [`PointIndex::points`].
    pub index: usize,
    /// Square of the distance to it.
    pub squared_distance: f64,
}

impl PointIndex {
    /// Sorts points into buckets of the given side, or of a wider one where they are far apart. `order[i]` of the
    /// second result is the index that point `i` of the index had in `points`. Points that are not finite, and points
    /// beyond the first 2^32, are left out.
    pub fn new(points: &[Point2], side: f64) -> (Self, Vec<usize>) {
        let is_finite = |point: &Point2| point.x.is_finite() && point.y.is_finite();
        let (places, finite): (Vec<usize>, Vec<Point2>) =
            points.iter().enumerate().filter(|(_, point)| is_finite(point)).unzip();
        let mut order = vec![0; finite.len()];
        let index = Self::in_buckets(&finite, Buckets::around(&finite, side), |from, to| order[to] = places[from]);
        (index, order)
    }

    /// Sorts points into buckets; those of one bucket stay in their order. `moved` is called with the old and the new
    /// index of each of them. Points beyond the first 2^32 are left out.
    pub fn in_buckets(points: &[Point2], buckets: Buckets, mut moved: impl FnMut(usize, usize)) -> Self {
        let points = &points[..points.len().min(u32::MAX as usize)];
        let numbers: Vec<usize> =
            points.iter().map(|point| buckets.row(point.y) * buckets.columns + buckets.column(point.x)).collect();
        // Points are counted two indices on, so that the starts can be used as the indices of the next points.
        let mut starts = vec![0u32; buckets.columns * buckets.rows + 2];
        for number in &numbers {
            starts[number + 2] += 1;
        }
        for number in 2..starts.len() {
            starts[number] += starts[number - 1];
        }
        let mut sorted = vec![Point2::origin(); points.len()];
        for (from, (point, number)) in points.iter().zip(numbers).enumerate() {
            let to = &mut starts[number + 1];
            sorted[*to as usize] = *point;
            moved(from, *to as usize);
            *to += 1;
        }
        Self { buckets, starts, points: sorted }
    }

    /// The points, bucket by bucket.
    pub fn points(&self) -> &[Point2] {
        &self.points
    }

    /// The buckets.
    pub fn buckets(&self) -> &Buckets {
        &self.buckets
    }

    /// Indices in [`points`](Self::points) of the points in a row of buckets from column `first` to `last`: the
    /// buckets of a row are contiguous.
    pub fn run(&self, row: usize, first: usize, last: usize) -> Range<usize> {
        let start = row * self.buckets.columns;
        self.starts[start + first] as usize..self.starts[start + last + 1] as usize
    }

    /// Indices in [`points`](Self::points) of the points within `radius` of `point`, in their order.
    pub fn within<'a>(&'a self, point: &Point2, radius: f64) -> impl Iterator<Item = usize> + use<'a> {
        let (buckets, point) = (self.buckets, *point);
        let (first_row, last_row) = (buckets.row(point.y - radius), buckets.row(point.y + radius));
        let (first, last) = (buckets.column(point.x - radius), buckets.column(point.x + radius));
        let is_near = move |index: &usize| (self.points[*index] - point).norm_squared() <= radius * radius;
        (first_row..=last_row).flat_map(move |row| self.run(row, first, last)).filter(is_near)
    }

    /// The point nearest to `point`, if one is within `radius` of it. Of several at equal distance it is the first.
    pub fn nearest(&self, point: &Point2, radius: f64) -> Option<Neighbour> {
        self.nearest_from(point, radius, usize::MAX)
    }

    /// The same, given the index of a point that may be near: the nearer it is, the fewer others are looked at. An
    /// index of no point is ignored.
    pub fn nearest_from(&self, point: &Point2, radius: f64, near: usize) -> Option<Neighbour> {
        self.two_nearest(point, radius, near, 0.0).nearest()
    }

    /// Looks for the nearest point within `radius`, and for the next that is at most `beyond` farther away.
    pub(super) fn two_nearest(&self, point: &Point2, radius: f64, near: usize, beyond: f64) -> TwoNearest {
        let Buckets { corner, side, columns, rows } = self.buckets;
        let local = (point - corner) / side;
        let mut found = TwoNearest::within(radius);
        if let Some(known) = self.points.get(near) {
            found.offer(near, (known - point).norm_squared());
        }
        // A little more, so that of points at equal distance the first is found.
        let reach_of = |found: &TwoNearest| ((1.0 + 1e-12) * found.limit.sqrt() + beyond) / side;
        let mut reach = reach_of(&found);
        // Written so that a value that is not a number fails it.
        let inside = local.x + reach >= 0.0
            && local.y + reach >= 0.0
            && local.x - reach < columns as f64
            && local.y - reach < rows as f64;
        if self.points.is_empty() || !inside {
            return found;
        }
        // There are fewer than 2^32 columns or rows, and a cast to 32 bits takes a fraction of the time.
        let clamp = |value: f64, count: usize| (value.max(0.0) as u32 as usize).min(count - 1);
        let (first_row, last_row) = (clamp(local.y - reach, rows), clamp(local.y + reach, rows));
        let home = clamp(local.y, rows);
        // Row of buckets by row, from the point's own outwards: what is found first narrows what follows.
        for step in 0..=(home - first_row).max(last_row - home) {
            for row in [home.checked_sub(step), (step > 0).then_some(home + step)].into_iter().flatten() {
                let below = row as f64 - local.y;
                let gap = below.max(-below - 1.0);
                if row < first_row || row > last_row || gap > reach {
                    continue;
                }
                let limit = found.limit;
                let run = self.run(row, clamp(local.x - reach, columns), clamp(local.x + reach, columns));
                for (index, candidate) in run.clone().zip(&self.points[run]) {
                    found.offer(index, (candidate - point).norm_squared());
                }
                if found.limit < limit {
                    reach = reach_of(&found);
                }
            }
        }
        found
    }
}

/// The nearest of the points so far, and how near another may be.
pub(super) struct TwoNearest {
    /// Index of the nearest; beyond all if there is none.
    index: usize,
    /// Square of the distance to it, or of the largest one.
    limit: f64,
    /// Square of the distance to the nearest of the others that were looked at, or of the largest one.
    pub(super) second: f64,
}

impl TwoNearest {
    fn within(radius: f64) -> Self {
        Self { index: usize::MAX, limit: radius * radius, second: radius * radius }
    }

    fn offer(&mut self, index: usize, squared_distance: f64) {
        if squared_distance < self.limit || (squared_distance == self.limit && index < self.index) {
            *self = Self { index, limit: squared_distance, second: self.limit };
        } else if squared_distance < self.second && index != self.index {
            self.second = squared_distance;
        }
    }

    pub(super) fn nearest(&self) -> Option<Neighbour> {
        (self.index < usize::MAX).then_some(Neighbour { index: self.index, squared_distance: self.limit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: f64 = 0.2;

    fn by_looking_at_all(points: &[Point2], point: &Point2, radius: f64) -> Option<f64> {
        let nearest = points.iter().map(|other| (other - point).norm_squared()).min_by(f64::total_cmp);
        nearest.filter(|squared| *squared <= radius * radius)
    }

    proptest! {
        #[test]
        fn the_nearest_point_is_that_of_a_test_of_all_points(
            points in prop::collection::vec((-5.0..5.0, -3.0..3.0), 0..200),
            x in -7.0..7.0, y in -7.0..7.0, radius in 0.0..3.0, near in 0usize..210,
        ) {
            let points: Vec<Point2> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let point = Point2::new(x, y);
            let (index, order) = PointIndex::new(&points, SIDE);
            let found = index.nearest(&point, radius);
            prop_assert_eq!(index.nearest_from(&point, radius, near), found);
            prop_assert_eq!(found.map(|found| found.squared_distance), by_looking_at_all(&points, &point, radius));
            if let Some(found) = found {
                prop_assert_eq!(index.points()[found.index], points[order[found.index]]);
            }
        }
    }

    proptest! {
        #[test]
        fn the_points_within_a_radius_are_those_of_a_test_of_all_points(
            points in prop::collection::vec((-5.0..5.0, -3.0..3.0), 0..200),
            x in -7.0..7.0, y in -7.0..7.0, radius in 0.0..3.0,
        ) {
            let points: Vec<Point2> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let point = Point2::new(x, y);
            let (index, _) = PointIndex::new(&points, SIDE);
            let found: Vec<usize> = index.within(&point, radius).collect();
            let is_near = |number: &usize| (index.points()[*number] - point).norm_squared() <= radius * radius;
            prop_assert_eq!(found, (0..points.len()).filter(is_near).collect::<Vec<_>>());
        }
    }

    #[test]
    fn an_empty_index_has_no_neighbours() {
        let (index, order) = PointIndex::new(&[], SIDE);
        assert_eq!(index.nearest(&Point2::origin(), f64::INFINITY), None);
        assert_eq!(index.within(&Point2::origin(), f64::INFINITY).count(), 0);
        assert!(order.is_empty());
    }

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let points = [Point2::new(f64::NAN, 0.0), Point2::new(1.0, 2.0), Point2::new(0.0, f64::INFINITY)];
        let (index, order) = PointIndex::new(&points, SIDE);
        assert_eq!(order, [1]);
        assert!(index.nearest(&Point2::new(1.0, 2.1), 0.2).is_some());
        assert_eq!(index.nearest(&Point2::new(f64::NAN, 2.1), 0.2), None);
        assert_eq!(index.nearest(&Point2::new(1.0, 2.1), f64::NAN), None);
    }

    #[test]
    fn points_far_apart_need_few_buckets() {
        let points = [Point2::new(-1e300, -1e300), Point2::new(1e300, 1e300), Point2::new(0.0, 0.0)];
        let (index, _) = PointIndex::new(&points, SIDE);
        assert!(index.starts.len() < 10_000);
        assert!(index.nearest(&Point2::new(0.05, 0.0), 0.1).is_some());
    }

    #[test]
    fn of_two_points_at_equal_distance_the_first_is_taken() {
        let points = [Point2::new(1.0, 0.0), Point2::new(-1.0, 0.0)];
        let (index, order) = PointIndex::new(&points, SIDE);
        let found = index.nearest(&Point2::origin(), 2.0).unwrap();
        assert_eq!(found.index, 0);
        assert_eq!(order, [1, 0], "the bucket of the smaller x comes first");
    }
}

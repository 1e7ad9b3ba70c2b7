//! Nearest neighbours among points that lie in the plane about as densely as the cells of a map.
//!
//! The points are sorted into square buckets, so that a query reads a few short runs of memory. For the two searches
//! that occur here, a small radius and points that are spread along walls, this takes a fraction of the time that a k-d
//! tree takes, and it settles ties by the order of the points, so that no result depends on the machine's vector
//! instructions.

use crate::geometry::Point2;

/// Side of a bucket, metres: near the last search radius of a registration, so that nine buckets hold the answer.
const BUCKET_SIDE: f64 = 0.2;

/// Points in buckets.
#[derive(Clone, Debug, Default)]
pub struct PointIndex {
    side: f64,
    corner: Point2,
    columns: usize,
    rows: usize,
    /// Where each bucket's points begin in `points`, row of buckets by row, and the end of the last.
    starts: Vec<u32>,
    /// The points, bucket by bucket.
    points: Vec<Point2>,
}

/// The nearest neighbour of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its place in [`PointIndex::points`].
    pub index: usize,
    /// Square of the distance to it, square metres.
    pub squared_distance: f64,
}

impl PointIndex {
    /// Sorts points into buckets. `order[i]` of the second result is the place that point `i` of the index had in
    /// `points`. Points that are not finite, and points beyond the first 2^32, are left out.
    pub fn new(points: &[Point2]) -> (Self, Vec<usize>) {
        let mut order: Vec<usize> = (0..points.len().min(u32::MAX as usize)).collect();
        order.retain(|&i| points[i].x.is_finite() && points[i].y.is_finite());
        let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        for point in order.iter().map(|&i| points[i]) {
            low = low.inf(&point);
            high = high.sup(&point);
        }
        if order.is_empty() {
            return (Self { side: BUCKET_SIDE, ..Self::default() }, order);
        }
        // Few points that lie far apart must not take many buckets.
        let most = 1024.0 + 64.0 * order.len() as f64;
        let mut side = BUCKET_SIDE;
        while ((high.x - low.x) / side + 1.0) * ((high.y - low.y) / side + 1.0) > most && side < f64::MAX / 4.0 {
            side *= 2.0;
        }
        let columns = ((high.x - low.x) / side) as usize + 1;
        let rows = ((high.y - low.y) / side) as usize + 1;
        let bucket = |point: &Point2| {
            let column = (((point.x - low.x) / side) as usize).min(columns - 1);
            let row = (((point.y - low.y) / side) as usize).min(rows - 1);
            row * columns + column
        };
        order.sort_by_key(|&i| (bucket(&points[i]), i));
        let sorted: Vec<Point2> = order.iter().map(|&i| points[i]).collect();
        let mut starts = vec![0u32; columns * rows + 1];
        for point in &sorted {
            starts[bucket(point) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        (Self { side, corner: low, columns, rows, starts, points: sorted }, order)
    }

    /// The points, in the order of the index.
    pub fn points(&self) -> &[Point2] {
        &self.points
    }

    /// The point nearest to `point`, if one lies within `radius` metres of it. Of several that are equally near it is
    /// the first.
    pub fn nearest(&self, point: &Point2, radius: f64) -> Option<Neighbour> {
        let local = (point - self.corner) / self.side;
        let reach = radius / self.side;
        let (column_end, row_end) = (self.columns as f64, self.rows as f64);
        // Written so that a value that is no number fails it.
        let inside = local.x + reach >= 0.0
            && local.y + reach >= 0.0
            && local.x - reach < column_end
            && local.y - reach < row_end;
        if self.points.is_empty() || !inside {
            return None;
        }
        let clamp = |value: f64, count: usize| (value.max(0.0) as usize).min(count - 1);
        let (first_row, last_row) = (clamp(local.y - reach, self.rows), clamp(local.y + reach, self.rows));
        let home = clamp(local.y, self.rows);
        let mut best: Option<Neighbour> = None;
        let mut limit = radius * radius;
        // Row of buckets by row, from the point's own outwards: what is found first narrows what follows.
        for step in 0..=(home - first_row).max(last_row - home) {
            for row in [home.checked_sub(step), (step > 0).then_some(home + step)].into_iter().flatten() {
                if row < first_row || row > last_row {
                    continue;
                }
                let below = row as f64 - local.y;
                let gap = below.max(-below - 1.0).max(0.0) * self.side;
                if gap * gap > limit {
                    continue;
                }
                let width = (limit - gap * gap).sqrt() / self.side;
                let first = row * self.columns + clamp(local.x - width, self.columns);
                let last = row * self.columns + clamp(local.x + width, self.columns);
                let run = self.starts[first] as usize..self.starts[last + 1] as usize;
                for (index, candidate) in run.clone().zip(&self.points[run]) {
                    let squared_distance = (candidate - point).norm_squared();
                    let closer = squared_distance < limit
                        || (squared_distance == limit && best.is_none_or(|best| index < best.index));
                    if closer {
                        limit = squared_distance;
                        best = Some(Neighbour { index, squared_distance });
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn by_looking_at_all(points: &[Point2], point: &Point2, radius: f64) -> Option<f64> {
        let nearest = points.iter().map(|other| (other - point).norm_squared()).min_by(f64::total_cmp);
        nearest.filter(|squared| *squared <= radius * radius)
    }

    proptest! {
        #[test]
        fn the_nearest_point_is_the_one_that_looking_at_all_finds(
            points in prop::collection::vec((-5.0..5.0, -3.0..3.0), 0..200),
            x in -7.0..7.0, y in -7.0..7.0, radius in 0.0..3.0,
        ) {
            let points: Vec<Point2> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
            let point = Point2::new(x, y);
            let (index, order) = PointIndex::new(&points);
            let found = index.nearest(&point, radius);
            prop_assert_eq!(found.map(|found| found.squared_distance), by_looking_at_all(&points, &point, radius));
            if let Some(found) = found {
                prop_assert_eq!(index.points()[found.index], points[order[found.index]]);
            }
        }
    }

    #[test]
    fn an_empty_index_has_no_neighbours() {
        let (index, order) = PointIndex::new(&[]);
        assert_eq!(index.nearest(&Point2::origin(), f64::INFINITY), None);
        assert!(order.is_empty());
    }

    #[test]
    fn points_that_are_no_numbers_are_left_out() {
        let points = [Point2::new(f64::NAN, 0.0), Point2::new(1.0, 2.0), Point2::new(0.0, f64::INFINITY)];
        let (index, order) = PointIndex::new(&points);
        assert_eq!(order, [1]);
        assert!(index.nearest(&Point2::new(1.0, 2.1), 0.2).is_some());
        assert_eq!(index.nearest(&Point2::new(f64::NAN, 2.1), 0.2), None);
        assert_eq!(index.nearest(&Point2::new(1.0, 2.1), f64::NAN), None);
    }

    #[test]
    fn points_that_lie_far_apart_take_few_buckets() {
        let points = [Point2::new(-1e300, -1e300), Point2::new(1e300, 1e300), Point2::new(0.0, 0.0)];
        let (index, _) = PointIndex::new(&points);
        assert!(index.starts.len() < 10_000);
        assert!(index.nearest(&Point2::new(0.05, 0.0), 0.1).is_some());
    }

    #[test]
    fn of_two_equally_near_points_the_first_is_taken() {
        let points = [Point2::new(1.0, 0.0), Point2::new(-1.0, 0.0)];
        let (index, order) = PointIndex::new(&points);
        let found = index.nearest(&Point2::origin(), 2.0).unwrap();
        assert_eq!(found.index, 0);
        assert_eq!(order, [1, 0], "the bucket of the smaller x comes first");
    }
}

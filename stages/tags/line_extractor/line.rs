//! Straight lines in the plane, in units of cells.

use super::faces::Correction;
use crate::shared::geometry::{Point2, quarter_turn};
use nalgebra::Vector2;

/// A straight line: a point on it and its unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    point: Point2,
    direction: Vector2<f64>,
}

impl Line {
    /// The line through two points. `None` if they coincide.
    pub(super) fn through(a: &Point2, b: &Point2) -> Option<Self> {
        let direction = (b - a).try_normalize(f64::MIN_POSITIVE)?;
        direction.iter().all(|v| v.is_finite()).then_some(Self { point: *a, direction })
    }

    /// The line with the least sum of squared distances to the points (total least squares). `None` if the points do
    /// not determine a direction.
    pub(super) fn least_squares(points: impl Iterator<Item = Point2> + Clone) -> Option<Self> {
        // Sums about one of the points keep their digits however far from the origin the points are.
        let reference = points.clone().next()?;
        let (mut x, mut y, mut xx, mut xy, mut yy, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for point in points {
            let offset = point - reference;
            x += offset.x;
            y += offset.y;
            xx += offset.x * offset.x;
            xy += offset.x * offset.y;
            yy += offset.y * offset.y;
            count += 1.0;
        }
        let mean = Vector2::new(x, y) / count;
        let (xx, xy, yy) = (xx - x * mean.x, xy - x * mean.y, yy - y * mean.y);
        let centre = reference + mean;
        let (difference, sum) = (xx - yy, xx + yy);
        let elongation = difference.hypot(2.0 * xy);
        if !(elongation.is_finite() && elongation > 1e-9 * sum) {
            return None;
        }
        let angle = 0.5 * (2.0 * xy).atan2(difference);
        Some(Self { point: centre, direction: Vector2::new(angle.cos(), angle.sin()) })
    }

    /// A point on the line.
    pub(super) fn point(&self) -> Point2 {
        self.point
    }

    /// The unit direction; its sign is arbitrary.
    pub(super) fn direction(&self) -> Vector2<f64> {
        self.direction
    }

    /// The line turned about its point at `along`, and moved across.
    pub(super) fn corrected(&self, along: f64, correction: &Correction) -> Option<Self> {
        let across = quarter_turn(&self.direction);
        let direction = (self.direction + across * correction.slope).try_normalize(f64::MIN_POSITIVE)?;
        let point = self.at(along) + across * correction.across;
        direction.iter().all(|v| v.is_finite()).then_some(Self { point, direction })
    }

    /// Signed distance of a point to the left of the line.
    pub(super) fn across(&self, point: &Point2) -> f64 {
        self.direction.perp(&(point - self.point))
    }

    /// Distance of a point from the line: equation 3 of Tsardoulias et al.
    pub(super) fn distance(&self, point: &Point2) -> f64 {
        self.across(point).abs()
    }

    /// Position along the line that is nearest to a point, as a signed distance from [`point`](Self::point).
    pub(super) fn along(&self, point: &Point2) -> f64 {
        self.direction.dot(&(point - self.point))
    }

    /// The point at a position along the line.
    pub(super) fn at(&self, along: f64) -> Point2 {
        self.point + self.direction * along
    }
}

/// A stretch of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// The line.
    pub(super) line: Line,
    /// Start of the stretch along the line.
    pub(super) start: f64,
    /// End of the stretch, at or after `start`.
    pub(super) end: f64,
}

impl Stretch {
    /// The stretch of `line` between its two farthest members. `None` without members.
    pub(super) fn between_farthest(line: Line, members: impl Iterator<Item = Point2>) -> Option<Self> {
        let (start, end) = members
            .map(|point| line.along(&point))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), along| (low.min(along), high.max(along)));
        (start <= end).then_some(Self { line, start, end })
    }

    /// The part along which everything within `reach` of the line is in the plane from (0, 0) to `size`. `None` if
    /// there is no such part.
    pub(super) fn inside(&self, size: &Vector2<f64>, reach: f64) -> Option<Self> {
        let (point, direction) = (self.line.point.coords, self.line.direction);
        let margin = quarter_turn(&direction).abs() * reach;
        if margin.x > size.x / 2.0 || margin.y > size.y / 2.0 {
            return None;
        }
        let (mut start, mut end) = (self.start, self.end);
        for axis in 0..2 {
            // Where the line crosses the two borders. A line along them crosses them infinitely far away.
            let low = (margin[axis] - point[axis]) / direction[axis];
            let high = (size[axis] - margin[axis] - point[axis]) / direction[axis];
            start = start.max(low.min(high));
            end = end.min(low.max(high));
        }
        (start < end).then_some(Self { line: self.line, start, end })
    }

    /// Length of the stretch.
    pub(super) fn length(&self) -> f64 {
        self.end - self.start
    }

    /// Its two ends.
    pub(super) fn ends(&self) -> [Point2; 2] {
        [self.line.at(self.start), self.line.at(self.end)]
    }

    /// Distance of a point from the stretch.
    pub(super) fn distance(&self, point: &Point2) -> f64 {
        let nearest = self.line.at(self.line.along(point).clamp(self.start, self.end));
        (point - nearest).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Equation 3 as it is printed: the distance of A from the line through B and C.
    fn equation_3(a: Point2, b: Point2, c: Point2) -> f64 {
        ((c.x - b.x) * (b.y - a.y) - (b.x - a.x) * (c.y - b.y)).abs() / (c.x - b.x).hypot(c.y - b.y)
    }

    proptest! {
        #[test]
        fn the_distance_is_that_of_equation_3(
            a in prop::array::uniform2(-9.0..9.0), b in prop::array::uniform2(-9.0..9.0),
            offset in prop::array::uniform2(0.1..9.0),
        ) {
            let (a, b) = (Point2::from(a), Point2::from(b));
            let c = b + Vector2::from(offset);
            let line = Line::through(&b, &c).unwrap();
            prop_assert!((line.distance(&a) - equation_3(a, b, c)).abs() < 1e-9);
            let foot = line.at(line.along(&a));
            prop_assert!(((a - foot).norm() - line.distance(&a)).abs() < 1e-9);
        }

        #[test]
        fn least_squares_finds_the_line_of_points_at_any_angle(angle in -4.0..4.0, x in -99.0..99.0, y in -99.0..99.0) {
            let direction = Vector2::new(f64::cos(angle), f64::sin(angle));
            let points = (0..20).map(|i| Point2::new(x, y) + direction * f64::from(i));
            let line = Line::least_squares(points.clone()).unwrap();
            prop_assert!(line.direction().perp(&direction).abs() < 1e-7);
            for point in points {
                prop_assert!(line.distance(&point) < 1e-6);
            }
        }
    }

    #[test]
    fn points_without_a_direction_have_no_line() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
        assert_eq!(Line::least_squares(square.into_iter()), None);
        assert_eq!(Line::least_squares(std::iter::empty()), None);
        assert_eq!(Line::least_squares(std::iter::once(square[1])), None);
        assert_eq!(Line::least_squares([Point2::new(f64::NAN, 0.0), square[1]].into_iter()), None);
        assert_eq!(Line::through(&square[2], &square[2]), None);
        assert_eq!(Line::through(&square[2], &Point2::new(f64::INFINITY, 0.0)), None);
    }

    #[test]
    fn a_stretch_reaches_to_its_farthest_members() {
        let line = Line::through(&Point2::new(5.0, 1.0), &Point2::new(6.0, 1.0)).unwrap();
        let members = [[3.0, 1.2], [9.0, 0.9], [4.0, 1.0]].map(Point2::from);
        let stretch = Stretch::between_farthest(line, members.into_iter()).unwrap();
        assert_eq!(stretch.ends(), [Point2::new(3.0, 1.0), Point2::new(9.0, 1.0)]);
        assert_eq!(stretch.length(), 6.0);
        assert_eq!(stretch.distance(&Point2::new(12.0, 5.0)), 5.0);
        assert_eq!(stretch.distance(&Point2::new(5.0, 3.0)), 2.0);
        assert_eq!(Stretch::between_farthest(line, std::iter::empty()), None);
    }

    #[test]
    fn a_stretch_is_inside_where_its_surroundings_are() {
        let size = Vector2::new(40.0, 30.0);
        let inside = |from: [f64; 2], to: [f64; 2], reach| {
            let line = Line::through(&from.into(), &to.into()).unwrap();
            let stretch = Stretch::between_farthest(line, [from, to].map(Point2::from).into_iter()).unwrap();
            stretch.inside(&size, reach).map(|part| part.ends())
        };
        assert_eq!(inside([5.0, 9.0], [30.0, 9.0], 3.0), Some([[5.0, 9.0].into(), [30.0, 9.0].into()]));
        assert_eq!(inside([0.0, 9.0], [50.0, 9.0], 3.0).unwrap()[1], Point2::new(40.0, 9.0));
        assert_eq!(inside([5.0, 2.0], [30.0, 2.0], 3.0), None);
        assert_eq!(inside([38.0, 20.0], [38.0, 2.0], 3.0), None);
        assert_eq!(inside([0.0, 15.0], [40.0, 16.0], 25.0), None);
        // A line at 45 degrees that leaves the plane at (30, 30): the border beside it is crossed a reach earlier.
        let end = inside([10.0, 10.0], [30.0, 30.0], 2.0_f64.sqrt()).unwrap()[1];
        assert!((end - Point2::new(29.0, 29.0)).norm() < 1e-9, "{end}");
    }
}

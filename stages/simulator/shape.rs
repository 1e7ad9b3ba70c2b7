//! The shapes that buildings are made of.

use crate::shared::geometry::{Point2, Pose2, pose};
use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// A rectangle along the axes of the building, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// The corner with the least x and y.
    pub min: Point2,
    /// The corner with the greatest x and y.
    pub max: Point2,
}

impl Rectangle {
    /// The rectangle between two opposite corners.
    pub fn new(x0: f64, y0: f64, x1: f64, y1: f64) -> Self {
        Self { min: Point2::new(x0.min(x1), y0.min(y1)), max: Point2::new(x0.max(x1), y0.max(y1)) }
    }

    /// The rectangle of the given sizes round a centre.
    pub fn round(centre: Point2, width: f64, height: f64) -> Self {
        Self::new(centre.x - width / 2.0, centre.y - height / 2.0, centre.x + width / 2.0, centre.y + height / 2.0)
    }

    /// The least rectangle that holds all points; `None` if there are none.
    pub fn bounding<'a>(points: impl IntoIterator<Item = &'a Point2>) -> Option<Self> {
        points.into_iter().fold(None, |bounds, point| {
            let Self { min, max } = bounds.unwrap_or(Self { min: *point, max: *point });
            Some(Self { min: min.inf(point), max: max.sup(point) })
        })
    }

    /// Its size along x.
    pub fn width(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// Its size along y.
    pub fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// Its middle.
    pub fn centre(&self) -> Point2 {
        nalgebra::center(&self.min, &self.max)
    }

    /// The same rectangle with every side moved outwards by `by` (inwards if negative).
    #[must_use]
    pub fn expanded(&self, by: f64) -> Self {
        Self { min: Point2::new(self.min.x - by, self.min.y - by), max: Point2::new(self.max.x + by, self.max.y + by) }
    }

    /// Whether it contains a point, including its border.
    pub fn contains(&self, point: &Point2) -> bool {
        (self.min.x..=self.max.x).contains(&point.x) && (self.min.y..=self.max.y).contains(&point.y)
    }

    /// Whether two rectangles have more than a border in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.x < other.max.x && other.min.x < self.max.x && self.min.y < other.max.y && other.min.y < self.max.y
    }
}

/// Something that a lidar beam does not pass: a convex polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Its corners in order, counter-clockwise, metres.
    pub corners: Vec<Point2>,
}

impl Solid {
    /// A box of the given sizes whose middle is at `pose`.
    pub fn turned_box(pose: &Pose2, length: f64, depth: f64) -> Self {
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
        Self { corners: corners.map(|(x, y)| pose * Point2::new(x * length, y * depth)).to_vec() }
    }

    /// A round thing, as a polygon of twelve sides.
    pub fn disc(centre: Point2, radius: f64) -> Self {
        let corner = |step: i32| pose(centre.x, centre.y, f64::from(step) * TAU / 12.0) * Point2::new(radius, 0.0);
        Self { corners: (0..12).map(corner).collect() }
    }

    /// Its sides, from corner to corner.
    pub fn sides(&self) -> impl Iterator<Item = (Point2, Point2)> + '_ {
        let ends = self.corners.iter().cycle().skip(1);
        self.corners.iter().copied().zip(ends.copied())
    }

    /// The distance of a point from it, metres; 0 inside.
    pub fn distance(&self, point: &Point2) -> f64 {
        let mut inside = true;
        let mut least = f64::INFINITY;
        for (from, to) in self.sides() {
            let along = to - from;
            let across = point - from;
            inside &= along.perp(&across) >= 0.0;
            let share = (across.dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            least = least.min((across - along * share).norm_squared());
        }
        if inside { 0.0 } else { least.sqrt() }
    }
}

impl From<Rectangle> for Solid {
    fn from(Rectangle { min, max }: Rectangle) -> Self {
        Self { corners: vec![min, Point2::new(max.x, min.y), max, Point2::new(min.x, max.y)] }
    }
}

/// A random number between `low` and `high`, which may be equal or the wrong way round.
pub(super) fn between(random: &mut impl Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.random::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_from_a_solid_is_zero_inside_and_to_the_nearest_side_outside() {
        let solid = Solid::from(Rectangle::new(0.0, 0.0, 2.0, 1.0));
        assert_eq!(solid.distance(&Point2::new(1.0, 0.5)), 0.0);
        assert_eq!(solid.distance(&Point2::new(1.0, 3.0)), 2.0);
        assert_eq!(solid.distance(&Point2::new(5.0, 5.0)), 5.0);
        let disc = Solid::disc(Point2::new(1.0, 1.0), 0.5);
        assert_eq!(disc.distance(&Point2::new(1.0, 1.0)), 0.0);
        assert!((disc.distance(&Point2::new(3.0, 1.0)) - 1.5).abs() < 1e-9);
    }

    #[test]
    fn rectangles_that_share_a_border_do_not_overlap() {
        let left = Rectangle::new(0.0, 0.0, 1.0, 1.0);
        assert!(!left.overlaps(&Rectangle::new(1.0, 0.0, 2.0, 1.0)));
        assert!(left.overlaps(&Rectangle::new(0.9, 0.9, 2.0, 2.0)));
    }

    #[test]
    fn nothing_has_no_bounds() {
        assert_eq!(Rectangle::bounding(&[]), None);
    }
}

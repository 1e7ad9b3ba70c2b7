//! Ray casting against the sides of solids, found through a grid of buckets.

use super::shape::{Rectangle, Solid};
use crate::shared::geometry::Point2;
use nalgebra::Vector2;

/// The side of a bucket, metres.
const BUCKET: f64 = 0.5;

/// The sides of solids, sorted into square buckets so that a ray tests only those along it.
#[derive(Clone, Debug)]
pub(super) struct RayCaster {
    min: Point2,
    columns: usize,
    rows: usize,
    /// Bucket `b` holds `sides[starts[b]..starts[b + 1]]`.
    starts: Vec<usize>,
    sides: Vec<Side>,
}

#[derive(Clone, Copy, Debug)]
struct Side {
    from: Point2,
    along: Vector2<f64>,
}

impl RayCaster {
    /// Sorts the sides of `solids`. Without solids every ray goes on for ever.
    pub(super) fn new(solids: &[Solid]) -> Self {
        let bounds = Rectangle::bounding(solids.iter().flat_map(|solid| &solid.corners))
            .unwrap_or(Rectangle::new(0.0, 0.0, 0.0, 0.0))
            .expanded(BUCKET);
        let columns = (bounds.width() / BUCKET).ceil().max(1.0) as usize;
        let rows = (bounds.height() / BUCKET).ceil().max(1.0) as usize;
        let mut buckets: Vec<Vec<Side>> = vec![Vec::new(); columns * rows];
        for (from, to) in solids.iter().flat_map(Solid::sides) {
            let low = (from.inf(&to) - bounds.min) / BUCKET;
            let high = (from.sup(&to) - bounds.min) / BUCKET;
            // A side on the border of two buckets belongs to both.
            let first = |v: f64| (v - 1e-9).max(0.0) as usize;
            let last = |v: f64, count: usize| ((v + 1e-9) as usize).min(count - 1);
            for row in first(low.y)..=last(high.y, rows) {
                for column in first(low.x)..=last(high.x, columns) {
                    buckets[row * columns + column].push(Side { from, along: to - from });
                }
            }
        }
        let mut starts = vec![0];
        let mut sides = Vec::new();
        for bucket in buckets {
            sides.extend(bucket);
            starts.push(sides.len());
        }
        Self { min: bounds.min, columns, rows, starts, sides }
    }

    /// Distance from `origin` to the first side in the direction `angle` (radians, building frame), metres; `None` if
    /// there is none within `reach`, or if `origin` is outside of the building.
    pub(super) fn cast(&self, origin: &Point2, angle: f64, reach: f64) -> Option<f64> {
        let direction = Vector2::new(angle.cos(), angle.sin());
        let start = (origin - self.min) / BUCKET;
        if !(start.x >= 0.0 && start.y >= 0.0 && start.x < self.columns as f64 && start.y < self.rows as f64) {
            return None;
        }
        let (mut column, mut row) = (start.x as usize, start.y as usize);
        let step = direction.map(|d| if d == 0.0 { f64::INFINITY } else { BUCKET / d.abs() });
        let mut next =
            Vector2::new(first_crossing(start.x, direction.x, step.x), first_crossing(start.y, direction.y, step.y));
        loop {
            let leaves_at = next.x.min(next.y);
            let hit = self.nearest_in(row * self.columns + column, origin, &direction);
            // A side may reach into this bucket and be met only in a later one.
            if hit <= leaves_at + 1e-9 {
                return (hit <= reach).then_some(hit);
            }
            if leaves_at > reach {
                return None;
            }
            let moved = if next.x < next.y {
                next.x += step.x;
                step_index(&mut column, direction.x, self.columns)
            } else {
                next.y += step.y;
                step_index(&mut row, direction.y, self.rows)
            };
            if !moved {
                return None;
            }
        }
    }

    /// Whether nothing is between two points. A side nearer than 3 cm to `to` does not count, so that an object fixed
    /// to a wall is visible.
    pub(super) fn sees(&self, from: &Point2, to: &Point2) -> bool {
        let way = to - from;
        self.cast(from, way.y.atan2(way.x), way.norm() - 0.03).is_none()
    }

    fn nearest_in(&self, bucket: usize, origin: &Point2, direction: &Vector2<f64>) -> f64 {
        let mut nearest = f64::INFINITY;
        for side in &self.sides[self.starts[bucket]..self.starts[bucket + 1]] {
            let across = side.from - origin;
            let denominator = direction.perp(&side.along);
            let distance = across.perp(&side.along) / denominator;
            let share = across.perp(direction) / denominator;
            // Parallel rays give infinities or NaN, which fail here.
            if distance >= 0.0 && (0.0..=1.0).contains(&share) {
                nearest = nearest.min(distance);
            }
        }
        nearest
    }
}

/// Distance along the ray at which it leaves its first bucket on one axis, metres.
fn first_crossing(start: f64, direction: f64, step: f64) -> f64 {
    let share = start - start.floor();
    match direction {
        d if d > 0.0 => (1.0 - share) * step,
        d if d < 0.0 => share * step,
        _ => f64::INFINITY,
    }
}

fn step_index(index: &mut usize, direction: f64, count: usize) -> bool {
    let moved = if direction > 0.0 { index.checked_add(1) } else { index.checked_sub(1) };
    match moved {
        Some(moved) if moved < count => *index = moved,
        _ => return false,
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn world() -> Vec<Solid> {
        vec![
            Rectangle::new(0.0, 0.0, 10.0, 0.2).into(),
            Rectangle::new(0.0, 6.0, 10.0, 6.2).into(),
            Rectangle::new(0.0, 0.0, 0.2, 6.2).into(),
            Rectangle::new(10.0, 0.0, 10.2, 6.2).into(),
            Solid::turned_box(&pose(5.0, 3.0, 0.6), 1.5, 0.7),
            Solid::disc(Point2::new(8.0, 4.0), 0.3),
        ]
    }

    proptest! {
        #[test]
        fn the_buckets_find_what_a_test_of_all_sides_finds(
            x in 0.3..9.9, y in 0.3..5.9, angle in -PI..PI, reach in 0.5..15.0,
        ) {
            let world = world();
            let origin = Point2::new(x, y);
            prop_assume!(world.iter().all(|solid| solid.distance(&origin) > 1e-6));
            let caster = RayCaster::new(&world);
            let all = RayCaster {
                min: Point2::new(-1e6, -1e6), columns: 1, rows: 1,
                starts: vec![0, caster.sides.len()], sides: caster.sides.clone(),
            };
            let expected = all.nearest_in(0, &origin, &Vector2::new(angle.cos(), angle.sin()));
            match caster.cast(&origin, angle, reach) {
                Some(distance) => prop_assert!((distance - expected).abs() < 1e-9),
                None => prop_assert!(expected > reach - 1e-9),
            }
        }
    }

    #[test]
    fn a_ray_along_an_axis_and_on_a_border_of_buckets_meets_the_wall() {
        let caster = RayCaster::new(&world());
        assert!((caster.cast(&Point2::new(1.0, 1.0), 0.0, 20.0).unwrap() - 9.0).abs() < 1e-9);
        assert!((caster.cast(&Point2::new(1.0, 1.0), PI / 2.0, 20.0).unwrap() - 5.0).abs() < 1e-9);
        assert_eq!(caster.cast(&Point2::new(1.0, 1.0), 0.0, 5.0), None);
    }

    #[test]
    fn outside_and_in_an_empty_world_nothing_is_met() {
        assert_eq!(RayCaster::new(&world()).cast(&Point2::new(-50.0, 0.0), 0.0, 100.0), None);
        assert_eq!(RayCaster::new(&world()).cast(&Point2::new(f64::NAN, 0.0), 0.0, 100.0), None);
        assert_eq!(RayCaster::new(&[]).cast(&Point2::new(0.0, 0.0), 1.0, 100.0), None);
    }

    #[test]
    fn a_point_on_a_wall_is_seen_from_its_own_side_only() {
        let caster = RayCaster::new(&world());
        let on_wall = Point2::new(3.0, 0.21);
        assert!(caster.sees(&Point2::new(2.0, 2.0), &on_wall));
        assert!(!caster.sees(&Point2::new(2.0, 2.0), &Point2::new(3.0, -0.01)));
    }
}

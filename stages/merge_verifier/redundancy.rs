//! How many of the walls that agree confirm a place, and do not only fix it.
//!
//! Two walls that are not parallel fix a place in all directions: any corner fits any other corner. So the two straight walls of
//! which most agrees say nothing of whether the place is right; what agrees beside them does.

use super::regions::OnWall;
use nalgebra::Vector2;
use std::f64::consts::PI;

/// So many directions of straight walls are looked at.
const DIRECTIONS: usize = 36;
/// The least cosine of the angle between the normals of a straight wall and of what belongs to it (10 degrees).
const SAME_DIRECTION: f64 = 0.985;
/// The largest cosine of the angle between the normals of two walls that fix a place in all directions (45 degrees).
const ANOTHER_DIRECTION: f64 = 0.707;
/// What belongs to a straight wall lies in a strip that is so wide: its two sides, and what it is bent by, metres.
const WIDTH: f64 = 0.3;

/// The share of the walls that agree which do not belong to the two that fix the place, 0 to 1; 0 if none agree.
pub(super) fn confirming_share(walls: &[OnWall]) -> f64 {
    let Some(first) = Strip::of_most(walls.iter()) else { return 0.0 };
    let beside = || walls.iter().filter(|wall| !first.holds(wall));
    let crosses = |wall: &&OnWall| wall.normal.dot(&first.normal).abs() < ANOTHER_DIRECTION;
    let second = Strip::of_most(beside().filter(crosses));
    let confirming = beside().filter(|wall| !second.as_ref().is_some_and(|second| second.holds(wall))).count();
    confirming as f64 / walls.len() as f64
}

/// Where a straight wall runs.
struct Strip {
    normal: Vector2<f64>,
    /// Along the normal, metres.
    start: f64,
}

impl Strip {
    /// The one that holds most of some walls; none if there are none.
    fn of_most<'a>(walls: impl Iterator<Item = &'a OnWall> + Clone) -> Option<Self> {
        let mut best: Option<(usize, Self)> = None;
        for direction in 0..DIRECTIONS {
            let (sine, cosine) = (PI * direction as f64 / DIRECTIONS as f64).sin_cos();
            let normal = Vector2::new(cosine, sine);
            let alike = walls.clone().filter(|wall| runs_along(wall, &normal));
            let mut offsets: Vec<f64> = alike.map(|wall| normal.dot(&wall.point.coords)).collect();
            offsets.sort_by(f64::total_cmp);
            let mut end = 0;
            for (index, &start) in offsets.iter().enumerate() {
                while offsets.get(end).is_some_and(|offset| *offset <= start + WIDTH) {
                    end += 1;
                }
                if best.as_ref().is_none_or(|(most, _)| end - index > *most) {
                    best = Some((end - index, Self { normal, start }));
                }
            }
        }
        best.map(|(_, strip)| strip)
    }

    fn holds(&self, wall: &OnWall) -> bool {
        let offset = self.normal.dot(&wall.point.coords);
        runs_along(wall, &self.normal) && (self.start..=self.start + WIDTH).contains(&offset)
    }
}

fn runs_along(wall: &OnWall, normal: &Vector2<f64>) -> bool {
    wall.normal.dot(normal).abs() >= SAME_DIRECTION
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point2;

    /// A straight wall, a point every 0.1 m.
    fn wall(from: (f64, f64), to: (f64, f64)) -> Vec<OnWall> {
        let (from, to) = (Point2::new(from.0, from.1), Point2::new(to.0, to.1));
        let along = to - from;
        let normal = Vector2::new(-along.y, along.x).normalize();
        let count = (along.norm() / 0.1).round() as usize;
        let point = |index: usize| OnWall { point: from + along * (index as f64 / count as f64), normal };
        (0..count).map(point).collect()
    }

    #[test]
    fn a_corner_fixes_a_place_and_confirms_nothing() {
        assert_eq!(confirming_share(&[]), 0.0);
        assert_eq!(confirming_share(&wall((0.0, 0.0), (10.0, 0.0))), 0.0);
        let corner = [wall((0.0, 0.0), (10.0, 0.0)), wall((0.0, 0.0), (0.0, 6.0))].concat();
        assert_eq!(confirming_share(&corner), 0.0);
        // Turned, and interrupted by a door.
        let slanted =
            [wall((1.0, 1.0), (4.0, 4.0)), wall((5.0, 5.0), (8.0, 8.0)), wall((1.0, 1.0), (-2.0, 4.0))].concat();
        assert_eq!(confirming_share(&slanted), 0.0);
    }

    #[test]
    fn the_walls_across_a_room_confirm_its_corner() {
        let room = [
            wall((0.0, 0.0), (10.0, 0.0)),
            wall((0.0, 0.0), (0.0, 6.0)),
            wall((0.0, 6.0), (10.0, 6.0)),
            wall((10.0, 0.0), (10.0, 6.0)),
        ];
        assert!((confirming_share(&room.concat()) - 0.5).abs() < 0.01);
        let corridor = [wall((0.0, 0.0), (10.0, 0.0)), wall((0.0, 2.0), (10.0, 2.0))].concat();
        assert!((confirming_share(&corridor) - 0.5).abs() < 0.01);
    }
}

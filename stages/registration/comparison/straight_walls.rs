//! Straight walls: what agrees and what contradicts, counted in walls, as neighbouring points of one wall are not
//! independent.
//!
//! Two walls that are not parallel fix a pose in all directions, as any corner fits any other corner. So the inliers
//! on the two longest straight walls are no evidence that the pose is right; only the further inliers are. And
//! parallel walls, as in a corridor or between rows of shelves, leave the position along them open: what counts is
//! the number of walls across.
//!
//! What contradicts is counted in walls, too: a long one that is off by its room is one contradiction, and three
//! short ones in different rooms are three.

use super::regions::ComparedWall;
use nalgebra::Vector2;
use std::f64::consts::PI;

/// Number of directions in which straight walls are sought.
const DIRECTIONS: usize = 36;
/// Least cosine of the angle between the normal of a straight wall and those of its points (10 degrees).
const SAME_DIRECTION: f64 = 0.985;
/// Largest cosine of the angle between the normals of two walls that fix a pose in all directions (45 degrees).
const ANOTHER_DIRECTION: f64 = 0.707;
/// Width of the strip that holds a straight wall: both of its sides, and its deformation, metres.
const WIDTH: f64 = 0.3;
/// Least length of inliers on a straight wall that confirms a pose, metres.
const LEAST_AGREEING: f64 = 0.5;
/// Least length of conflicts on a straight wall that contradicts a pose, metres: more than a piece of furniture has.
const LEAST_CONFLICTING: f64 = 1.0;
/// More walls in a direction are no further evidence for a pose, and more that contradict it none against it. Chosen
/// by cross-validation, with the weights of the judgement: from 6 to 10 it hardly matters.
const MOST_WALLS: usize = 8;

/// Independent constraints from the inliers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct StraightWalls {
    /// Share of the inliers outside the two walls that fix the pose, 0 to 1; 0 if there are none.
    pub(super) independent_share: f64,
    /// Number of straight walls along the longest one or across it, the fewer of both; at most eight.
    pub(super) constraints: usize,
}

impl StraightWalls {
    /// Counts the straight walls among inliers that are `spacing` metres of wall each.
    pub(super) fn of(inliers: &[ComparedWall], spacing: f64) -> Self {
        let strips = Strips::new(inliers);
        let mut all = strips.longest_first(spacing, LEAST_AGREEING);
        let Some((longest, fixing)) = all.next() else { return Self::default() };
        let (mut along, mut across, mut second) = (1, 0, 0);
        for (strip, points) in all {
            if strip.normal.dot(&longest.normal).abs() > ANOTHER_DIRECTION {
                along += 1;
            } else {
                across += 1;
                second = second.max(points);
            }
            if along.min(across) == MOST_WALLS {
                break;
            }
        }
        let independent_share = (inliers.len() - fixing - second) as f64 / inliers.len() as f64;
        Self { independent_share, constraints: along.min(across) }
    }
}

/// Number of straight walls on conflicts, which are `spacing` metres of wall each; at most eight.
pub(super) fn conflicting_walls(conflicts: &[ComparedWall], spacing: f64) -> usize {
    Strips::new(conflicts).longest_first(spacing, LEAST_CONFLICTING).take(MOST_WALLS).count()
}

/// Points of walls, by the direction of the wall.
struct Strips<'a> {
    walls: &'a [ComparedWall],
    directions: Vec<Direction>,
}

/// Points of walls that run in one direction.
struct Direction {
    /// Unit normal of the direction.
    normal: Vector2<f64>,
    /// Offset of each point along the normal, metres, and its index; the least first.
    offsets: Vec<(f64, usize)>,
}

impl<'a> Strips<'a> {
    fn new(walls: &'a [ComparedWall]) -> Self {
        let direction = |number: usize| {
            let (sine, cosine) = (PI * number as f64 / DIRECTIONS as f64).sin_cos();
            let normal = Vector2::new(cosine, sine);
            let alike = walls.iter().enumerate().filter(|(_, wall)| runs_along(wall, &normal));
            let mut offsets: Vec<(f64, usize)> =
                alike.map(|(index, wall)| (normal.dot(&wall.point.coords), index)).collect();
            offsets.sort_by(|one, other| one.0.total_cmp(&other.0));
            Direction { normal, offsets }
        };
        Self { walls, directions: (0..DIRECTIONS).map(direction).collect() }
    }

    /// The strips that hold at least a length, metres, of points that no earlier one holds, and the number of these.
    fn longest_first(&self, spacing: f64, least_length: f64) -> impl Iterator<Item = (Strip, usize)> {
        let mut left = vec![true; self.walls.len()];
        std::iter::from_fn(move || {
            let (points, strip) = self.of_most(|index| left[index])?;
            strip.take_from(self.walls, &mut left);
            (points as f64 * spacing >= least_length).then_some((strip, points))
        })
    }

    /// The strip that holds most of the requested points, and their number; none if there are none.
    fn of_most(&self, is_asked_for: impl Fn(usize) -> bool) -> Option<(usize, Strip)> {
        let mut best: Option<(usize, Strip)> = None;
        for Direction { normal, offsets } in &self.directions {
            let (mut end, mut count) = (0, 0);
            for &(start, index) in offsets {
                while let Some((_, last)) = offsets.get(end).filter(|(offset, _)| *offset <= start + WIDTH) {
                    count += usize::from(is_asked_for(*last));
                    end += 1;
                }
                if !is_asked_for(index) {
                    continue;
                }
                if best.as_ref().is_none_or(|(most, _)| count > *most) {
                    best = Some((count, Strip { normal: *normal, start }));
                }
                count -= 1;
            }
        }
        best
    }
}

/// A straight strip of constant width.
struct Strip {
    normal: Vector2<f64>,
    /// Offset along the normal, metres.
    start: f64,
}

impl Strip {
    fn holds(&self, wall: &ComparedWall) -> bool {
        let offset = self.normal.dot(&wall.point.coords);
        runs_along(wall, &self.normal) && (self.start..=self.start + WIDTH).contains(&offset)
    }

    /// Clears the flags of the points in the strip.
    fn take_from(&self, walls: &[ComparedWall], left: &mut [bool]) {
        walls.iter().zip(left).filter(|(wall, _)| self.holds(wall)).for_each(|(_, left)| *left = false);
    }
}

fn runs_along(wall: &ComparedWall, normal: &Vector2<f64>) -> bool {
    wall.normal.dot(normal).abs() >= SAME_DIRECTION
}

#[cfg(test)]
mod tests {
    use super::super::regions::Finding;
    use super::*;
    use crate::shared::geometry::Point2;

    const SPACING: f64 = 0.1;

    /// A straight wall, a point every 0.1 m.
    fn wall(from: (f64, f64), to: (f64, f64)) -> Vec<ComparedWall> {
        let (from, to) = (Point2::new(from.0, from.1), Point2::new(to.0, to.1));
        let along = to - from;
        let normal = Vector2::new(-along.y, along.x).normalize();
        let count = (along.norm() / SPACING).round() as usize;
        let point = |index: usize| ComparedWall {
            of_b: true,
            index,
            point: from + along * (index as f64 / count as f64),
            normal,
            finding: Finding::Inlier,
        };
        (0..count).map(point).collect()
    }

    fn of(walls: &[ComparedWall]) -> StraightWalls {
        StraightWalls::of(walls, SPACING)
    }

    #[test]
    fn a_corner_fixes_a_pose_and_leaves_no_independent_inliers() {
        assert_eq!(of(&[]), StraightWalls::default());
        assert_eq!(of(&wall((0.0, 0.0), (10.0, 0.0))), StraightWalls::default());
        let corner = StraightWalls { independent_share: 0.0, constraints: 1 };
        assert_eq!(of(&[wall((0.0, 0.0), (10.0, 0.0)), wall((0.0, 0.0), (0.0, 6.0))].concat()), corner);
        // Turned, and interrupted by a door.
        let slanted =
            [wall((1.0, 1.0), (4.0, 4.0)), wall((5.0, 5.0), (8.0, 8.0)), wall((1.0, 1.0), (-2.0, 4.0))].concat();
        assert_eq!(of(&slanted), corner);
    }

    #[test]
    fn the_walls_across_a_room_confirm_its_corner() {
        let room = [
            wall((0.0, 0.0), (10.0, 0.0)),
            wall((0.0, 0.0), (0.0, 6.0)),
            wall((0.0, 6.0), (10.0, 6.0)),
            wall((10.0, 0.0), (10.0, 6.0)),
        ];
        let room = of(&room.concat());
        assert!((room.independent_share - 0.5).abs() < 0.01 && room.constraints == 2, "{room:?}");
    }

    #[test]
    fn parallel_walls_are_no_constraint_along_them() {
        let rows: Vec<ComparedWall> =
            (0..8).flat_map(|row| wall((0.0, 2.0 * f64::from(row)), (10.0, 2.0 * f64::from(row)))).collect();
        assert_eq!(of(&rows).constraints, 0);
        let with_a_post = [rows, wall((10.0, 0.0), (10.0, 0.3))].concat();
        assert_eq!(of(&with_a_post).constraints, 0, "a piece as short as a post is no wall");
    }

    #[test]
    fn doors_do_not_split_a_wall_and_more_than_eight_walls_are_no_further_evidence() {
        let rooms: Vec<ComparedWall> = (0..9)
            .flat_map(|number| {
                let x = 4.0 * f64::from(number);
                [wall((x, 0.0), (x, 3.0)), wall((x, 4.0), (x, 7.0)), wall((x, 0.0), (x + 3.0, 0.0))].concat()
            })
            .collect();
        assert_eq!(of(&rooms).constraints, 1, "one long wall with doors, and nine across");
        let shifted: Vec<ComparedWall> =
            (0..9).flat_map(|row| wall((0.0, f64::from(row)), (36.0, f64::from(row)))).collect();
        assert_eq!(of(&[rooms, shifted].concat()).constraints, 8);
    }

    #[test]
    fn conflicts_count_by_walls_and_not_by_metres() {
        let count = |walls: &[ComparedWall]| conflicting_walls(walls, SPACING);
        assert_eq!(count(&[]), 0);
        assert_eq!(count(&wall((0.0, 0.0), (20.0, 0.0))), 1, "one long wall");
        let rooms = [wall((0.0, 0.0), (1.2, 0.0)), wall((9.0, 4.0), (9.0, 5.2)), wall((3.0, 8.0), (4.2, 8.0))];
        assert_eq!(count(&rooms.concat()), 3);
        let chairs = [wall((0.0, 0.0), (0.5, 0.0)), wall((5.0, 2.0), (5.5, 2.0))];
        assert_eq!(count(&chairs.concat()), 0);
    }
}

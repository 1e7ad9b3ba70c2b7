//! Walls of one map that cross the free space of the other, which maps of one place hardly have.
//!
//! In a deformed or roughly drawn map, walls are beside those of the other. A small piece alone in free space is a
//! leg, a person or a chair, and may have moved. A piece as long as a door is wide is a wall, as a rule, and two maps
//! of one place seldom disagree about walls in the middle of their rooms.

use crate::shared::geometry::Point2;
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// Least extent of a wall, metres: about as wide as a door, and larger than what is easily moved.
const LEAST_EXTENT: f64 = 0.7;
/// Points are connected if they are in squares of this side that touch, metres.
const LINK: f64 = 0.25;

/// Number of the points on free space that belong to a connected piece large enough to be a wall. `spacing` is the
/// distance of neighbouring points, metres.
pub(super) fn points_of_walls(points: &[Point2], spacing: f64) -> usize {
    let side = LINK.max(spacing);
    let mut squares: BTreeMap<(i32, i32), Vec<Point2>> = BTreeMap::new();
    for point in points {
        squares.entry(((point.x / side).floor() as i32, (point.y / side).floor() as i32)).or_default().push(*point);
    }
    let mut left: BTreeSet<(i32, i32)> = squares.keys().copied().collect();
    let mut count = 0;
    while let Some(first) = left.pop_first() {
        let piece: Vec<&Point2> = connected(first, &mut left).iter().flat_map(|square| &squares[square]).collect();
        if extent(&piece) >= LEAST_EXTENT {
            count += piece.len();
        }
    }
    count
}

/// The squares connected with the first one, removed from `left`.
fn connected(first: (i32, i32), left: &mut BTreeSet<(i32, i32)>) -> Vec<(i32, i32)> {
    let mut found = vec![first];
    let mut next = 0;
    while let Some(&(x, y)) = found.get(next) {
        next += 1;
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x.saturating_add(dx), y.saturating_add(dy))));
        found.extend(around.filter(|square| left.remove(square)));
    }
    found
}

/// Diagonal of the rectangle around some points, metres.
fn extent(points: &[&Point2]) -> f64 {
    let low = points.iter().fold(Vector2::repeat(f64::INFINITY), |low, point| low.inf(&point.coords));
    let high = points.iter().fold(Vector2::repeat(f64::NEG_INFINITY), |high, point| high.sup(&point.coords));
    (high - low).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points along a straight line, one every 5 cm.
    fn line(from: (f64, f64), to: (f64, f64)) -> Vec<Point2> {
        let (from, to) = (Point2::new(from.0, from.1), Point2::new(to.0, to.1));
        let count = ((to - from).norm() / 0.05).round() as usize;
        (0..=count).map(|index| from + (to - from) * (index as f64 / count as f64)).collect()
    }

    #[test]
    fn a_wall_crosses_free_space_and_a_chair_does_not() {
        let wall = line((-1.0, 2.0), (1.0, 3.0));
        let chair = [line((5.0, 5.0), (5.4, 5.0)), line((5.4, 5.0), (5.4, 5.4))].concat();
        assert_eq!(points_of_walls(&[], 0.05), 0);
        assert_eq!(points_of_walls(&chair, 0.05), 0);
        assert_eq!(points_of_walls(&wall, 0.05), wall.len());
        assert_eq!(points_of_walls(&[chair, wall.clone()].concat(), 0.05), wall.len());
    }

    #[test]
    fn the_legs_of_a_table_are_no_wall_and_coarse_points_are() {
        let at = |x: f64| Point2::new(x, 0.0);
        assert_eq!(points_of_walls(&[at(0.0), at(0.8), at(1.6)], 0.05), 0);
        assert_eq!(points_of_walls(&[at(0.0), at(0.4), at(0.8), at(1.2)], 0.4), 4);
    }
}

//! Path planning: A* over the raster of free space, with a cost near walls, and then smoothing.

use super::clearances::{Clearances, FREE_CLEARANCE, ROBOT_RADIUS};
use crate::shared::geometry::Point2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Cost of a metre where a robot only just fits, relative to open space.
const WALL_COST: f64 = 3.0;
/// Costs are whole numbers, so that they have an order: tenths of a millimetre.
const UNITS_PER_METRE: f64 = 10_000.0;
/// Passes of smoothing.
const SMOOTHING: usize = 40;

/// The cheapest path between two points, as points about 0.1 m apart; `None` if one cannot be reached from the other.
/// Near walls a metre costs more.
pub(super) fn plan_path(space: &Clearances, from: &Point2, to: &Point2) -> Option<Vec<Point2>> {
    let (start, goal) = (space.index(from), space.index(to));
    if !(space.is_reachable_at(start) && space.is_reachable_at(goal)) {
        return None;
    }
    let target = space.centre(goal);
    let ahead = |index: usize| units((space.centre(index) - target).norm());
    let mut costs = vec![u64::MAX; space.cell_count()];
    let mut parents = vec![usize::MAX; space.cell_count()];
    let mut queue = BinaryHeap::from([Reverse((ahead(start), start))]);
    costs[start] = 0;
    while let Some(Reverse((estimate, index))) = queue.pop() {
        if index == goal {
            return Some(trace(space, &parents, goal));
        }
        if estimate > costs[index].saturating_add(ahead(index)) {
            continue;
        }
        for (neighbour, length) in space.neighbours(index).into_iter().flatten() {
            if !space.is_reachable_at(neighbour) {
                continue;
            }
            let tightness = 1.0 - space.clearance_at(neighbour) / FREE_CLEARANCE;
            let cost = costs[index] + units(length * (1.0 + WALL_COST * tightness));
            if cost < costs[neighbour] {
                costs[neighbour] = cost;
                parents[neighbour] = index;
                queue.push(Reverse((cost + ahead(neighbour), neighbour)));
            }
        }
    }
    None
}

fn units(metres: f64) -> u64 {
    (metres * UNITS_PER_METRE) as u64
}

fn trace(space: &Clearances, parents: &[usize], goal: usize) -> Vec<Point2> {
    let steps = std::iter::successors(Some(goal), |&index| parents.get(index).copied().filter(|&p| p != usize::MAX));
    let mut path: Vec<Point2> = steps.map(|index| space.centre(index)).collect();
    path.reverse();
    path
}

/// Smooths the corners of the raster: every point moves towards the midpoint of its neighbours as long as a robot
/// fits there. The ends stay.
pub(super) fn smooth_path(space: &Clearances, path: &mut [Point2]) {
    for _ in 0..SMOOTHING {
        for index in 1..path.len().saturating_sub(1) {
            let middle = nalgebra::center(&path[index - 1], &path[index + 1]);
            let moved = nalgebra::center(&path[index], &middle);
            if space.clearance(&moved) >= ROBOT_RADIUS && space.is_reachable(&moved) {
                path[index] = moved;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::shape::{Rectangle, Solid};

    /// A room cut in two by a wall with a gap at its upper end, and a closed box in the right half.
    fn space() -> Clearances {
        let solids: Vec<Solid> = [
            Rectangle::new(0.0, -0.1, 6.0, 0.0),
            Rectangle::new(0.0, 4.0, 6.0, 4.1),
            Rectangle::new(-0.1, 0.0, 0.0, 4.0),
            Rectangle::new(6.0, 0.0, 6.1, 4.0),
            Rectangle::new(2.9, 0.0, 3.1, 3.0),
            Rectangle::new(4.5, 0.0, 4.6, 1.6),
            Rectangle::new(4.5, 1.5, 6.0, 1.6),
        ]
        .map(Solid::from)
        .to_vec();
        Clearances::new(&Rectangle::new(0.0, 0.0, 6.0, 4.0), &solids, &Point2::new(1.0, 1.0))
    }

    #[test]
    fn a_path_goes_round_a_wall_and_keeps_the_clearance_of_the_robot() {
        let space = space();
        let mut way = plan_path(&space, &Point2::new(1.0, 1.0), &Point2::new(4.0, 0.6)).unwrap();
        smooth_path(&space, &mut way);
        assert!(way.iter().all(|point| space.clearance(point) >= ROBOT_RADIUS));
        assert!(way.iter().any(|point| point.y > 3.2), "it takes the gap");
        assert!(way.windows(2).all(|pair| (pair[1] - pair[0]).norm() < 0.2));
        let length: f64 = way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        assert!(length < 7.5, "{length}");
    }

    #[test]
    fn there_is_no_way_into_a_closed_box_or_into_a_wall() {
        let space = space();
        let start = Point2::new(1.0, 1.0);
        for goal in [Point2::new(5.3, 0.8), Point2::new(3.0, 1.0), Point2::new(-50.0, f64::NAN)] {
            assert_eq!(plan_path(&space, &start, &goal), None);
        }
    }

    #[test]
    fn smoothing_keeps_the_ends_and_takes_ways_of_no_points() {
        let space = space();
        let mut way = [Point2::new(1.0, 1.0), Point2::new(1.5, 1.2), Point2::new(2.0, 1.0)];
        smooth_path(&space, &mut way);
        assert_eq!((way[0], way[2]), (Point2::new(1.0, 1.0), Point2::new(2.0, 1.0)));
        smooth_path(&space, &mut []);
    }
}

//! The way from one place to another: A* over the raster of free space, kept away from walls, and then smoothed.

use super::free_space::{FREE_CLEARANCE, FreeSpace, ROBOT_RADIUS};
use crate::geometry::Point2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How much dearer a metre is where a robot only just fits than in the open.
const WALL_COST: f64 = 3.0;
/// Costs are whole numbers, so that they have an order: tenths of a millimetre.
const UNITS_PER_METRE: f64 = 10_000.0;
/// Passes of smoothing.
const SMOOTHING: usize = 40;

/// The cheapest way between two places, as points about 0.1 m apart; `None` if one cannot be reached from the other.
/// Near walls a metre costs more.
pub fn plan_path(space: &FreeSpace, from: &Point2, to: &Point2) -> Option<Vec<Point2>> {
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

fn trace(space: &FreeSpace, parents: &[usize], goal: usize) -> Vec<Point2> {
    let steps = std::iter::successors(Some(goal), |&index| parents.get(index).copied().filter(|&p| p != usize::MAX));
    let mut path: Vec<Point2> = steps.map(|index| space.centre(index)).collect();
    path.reverse();
    path
}

/// Takes the corners of the raster out of a way: every point moves towards the middle of its neighbours for as long as
/// a robot fits there. The ends stay.
pub(super) fn smooth_path(space: &FreeSpace, path: &mut [Point2]) {
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

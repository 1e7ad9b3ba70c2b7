//! Costmaps: obstacles with the costs around them.

use super::LETHAL;
use gridweave_runtime::ros::cell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The least cost of a known cell beside an obstacle of a costmap.
const BESIDE_LETHAL: i8 = 90;
/// The share of known cells beside obstacles that have at least this cost in a costmap.
const COSTMAP_SHARE: f64 = 0.9;

/// The neighbours of a cell that share an edge with it.
fn neighbours(width: usize, length: usize, index: usize) -> impl Iterator<Item = usize> {
    let column = index % width.max(1);
    let left = (column > 0).then(|| index - 1);
    let right = (column + 1 < width).then_some(index + 1);
    let (down, up) = (index.checked_sub(width), Some(index + width));
    [left, right, down, up].into_iter().flatten().filter(move |neighbour| *neighbour < length)
}

/// Whether known cells beside obstacles have high costs.
pub(super) fn obstacles_are_inflated(width: usize, cells: &[i8]) -> bool {
    let (mut known, mut inflated) = (0_u64, 0_u64);
    for (index, _) in cells.iter().enumerate().filter(|(_, value)| **value == LETHAL) {
        for beside in neighbours(width, cells.len(), index).map(|neighbour| cells[neighbour]) {
            if cell::is_known(beside) && beside != LETHAL {
                known += 1;
                inflated += u64::from(beside >= BESIDE_LETHAL);
            }
        }
    }
    known > 0 && inflated as f64 >= COSTMAP_SHARE * known as f64
}

/// The cells of a costmap without the costs around obstacles: free on the side from which the cost falls to that of
/// free space, unknown on the side from which it falls to unknown cells. The sides are found by flooding the costs from
/// both (the watershed of Meyer, "Topographic distance and watershed lines", 1994); obstacles are the ridges between
/// them.
pub(super) fn without_costs(width: usize, cells: &[i8]) -> Vec<i8> {
    let is_cost = |value: i8| (1..LETHAL).contains(&value);
    let unflooded = |value: i8| match value {
        _ if is_cost(value) => i8::MIN,
        _ if cell::is_known(value) => value,
        _ => cell::UNKNOWN,
    };
    let mut read: Vec<i8> = cells.iter().map(|value| unflooded(*value)).collect();
    let mut queue = BinaryHeap::new();
    let mut order = 0_u64;
    let mut flood = |from: usize, read: &mut [i8], queue: &mut BinaryHeap<Reverse<(i8, u64, usize)>>| {
        for next in neighbours(width, cells.len(), from) {
            if read[next] == i8::MIN {
                read[next] = read[from];
                order += 1;
                queue.push(Reverse((cells[next], order, next)));
            }
        }
    };
    // Free space goes first: where a cost lies between both sides, something has seen it.
    for side in [0, cell::UNKNOWN] {
        for index in 0..cells.len() {
            if read[index] == side && !is_cost(cells[index]) {
                flood(index, &mut read, &mut queue);
            }
        }
    }
    while let Some(Reverse((_, _, index))) = queue.pop() {
        flood(index, &mut read, &mut queue);
    }
    // What neither side reaches lies within obstacles.
    read.iter_mut().filter(|value| **value == i8::MIN).for_each(|value| *value = cell::UNKNOWN);
    read
}

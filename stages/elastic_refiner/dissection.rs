//! The order in which the nodes of all maps are eliminated.

use crate::geometry::Point2;

/// So few nodes are not divided any further.
const LEAST_NODES: usize = 16;

/// The nodes in an order that leaves the factor of their equations sparse: what lies on one side of a line, what lies on the
/// other, and last those of one side that have to do with the other; and so on within each side (nested dissection, George 1973, by where
/// the nodes lie). `neighbours` are for each node those that it shares an equation with.
pub(super) fn dissected(places: &[Point2], neighbours: &[Vec<usize>]) -> Vec<usize> {
    let mut order = Vec::with_capacity(places.len());
    let mut side_of = vec![0; places.len()];
    let mut sides = 0;
    // What is still to be put in order, the next last; what separates two sides comes after them.
    let mut parts: Vec<(Vec<usize>, bool)> = vec![((0..places.len()).collect(), true)];
    while let Some((mut nodes, is_divisible)) = parts.pop() {
        sort_along(&mut nodes, places);
        if !is_divisible || nodes.len() <= LEAST_NODES {
            order.extend(nodes);
            continue;
        }
        let high = nodes.split_off(nodes.len() / 2);
        sides += 1;
        high.iter().for_each(|&node| side_of[node] = sides);
        let borders = |node: &usize| neighbours[*node].iter().any(|&other| side_of[other] == sides);
        let (border, low): (Vec<usize>, Vec<usize>) = nodes.into_iter().partition(borders);
        parts.extend([(border, false), (high, true), (low, true)]);
    }
    order
}

/// Sorts nodes along the longer side of the rectangle that holds them.
fn sort_along(nodes: &mut [usize], places: &[Point2]) {
    let Some(&first) = nodes.first() else { return };
    let corners = (places[first], places[first]);
    let (low, high) =
        nodes.iter().fold(corners, |(low, high), &node| (low.inf(&places[node]), high.sup(&places[node])));
    let is_wide = high.x - low.x > high.y - low.y;
    let along = |node: usize| if is_wide { (places[node].x, places[node].y) } else { (places[node].y, places[node].x) };
    nodes.sort_by(|&one, &other| {
        let (one_at, other_at) = (along(one), along(other));
        one_at.0.total_cmp(&other_at.0).then(one_at.1.total_cmp(&other_at.1)).then(one.cmp(&other))
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_separates_two_sides_comes_after_both() {
        // A strip of 8 x 4 nodes, each tied to those beside it.
        let places: Vec<Point2> = (0..32).map(|node| Point2::new(f64::from(node % 8), f64::from(node / 8))).collect();
        let is_near = |one: usize, other: usize| (places[one] - places[other]).norm() < 1.1 && one != other;
        let neighbours: Vec<Vec<usize>> =
            (0..32).map(|one| (0..32).filter(|&other| is_near(one, other)).collect()).collect();
        let order = dissected(&places, &neighbours);
        let mut all = order.clone();
        all.sort_unstable();
        assert_eq!(all, (0..32).collect::<Vec<_>>(), "each node once");
        assert!(order[28..].iter().all(|&node| places[node].x == 3.0), "{order:?}");
        assert!(order[..12].iter().all(|&node| places[node].x < 3.0), "{order:?}");
        assert!(dissected(&[], &[]).is_empty());
    }
}

//! Elimination order of the nodes of all maps.

use crate::shared::geometry::Point2;

/// Sets of fewer nodes are not divided any further.
const LEAST_NODES: usize = 16;

/// Computes the position of each node in an elimination order with a sparse factor: the nodes on one side of a line,
/// those on the other, and last those of one side with equations to the other; and so on within each side (nested
/// dissection, George 1973, by the positions of the nodes). `neighbours` are for each node those with a common
/// equation.
pub(crate) fn nested_dissection(at: &[Point2], neighbours: &[Vec<usize>]) -> Vec<usize> {
    let mut division = Division { at, neighbours, side_of: vec![0; at.len()], sides: 0, order: Vec::new() };
    division.divide((0..at.len()).collect());
    let mut places = vec![0; at.len()];
    division.order.into_iter().enumerate().for_each(|(place, node)| places[node] = place);
    places
}

/// State while nodes are ordered.
struct Division<'a> {
    at: &'a [Point2],
    neighbours: &'a [Vec<usize>],
    /// Side of each node in the latest division.
    side_of: Vec<usize>,
    sides: usize,
    order: Vec<usize>,
}

impl Division<'_> {
    /// Appends nodes to the order. The number halves each time, so the recursion is as deep as its number of bits.
    fn divide(&mut self, mut nodes: Vec<usize>) {
        sort_along(&mut nodes, self.at);
        if nodes.len() <= LEAST_NODES {
            self.order.extend(nodes);
            return;
        }
        let high = nodes.split_off(nodes.len() / 2);
        self.sides += 1;
        high.iter().for_each(|&node| self.side_of[node] = self.sides);
        let borders = |node: &usize| self.neighbours[*node].iter().any(|&other| self.side_of[other] == self.sides);
        let (mut border, low): (Vec<usize>, Vec<usize>) = nodes.into_iter().partition(borders);
        self.divide(low);
        self.divide(high);
        sort_along(&mut border, self.at);
        self.order.extend(border);
    }
}

/// Sorts nodes along the longer side of their bounding box.
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
        // A strip of 8 x 4 nodes, each connected with those beside it.
        let places: Vec<Point2> = (0..32).map(|node| Point2::new(f64::from(node % 8), f64::from(node / 8))).collect();
        let is_near = |one: usize, other: usize| (places[one] - places[other]).norm() < 1.1 && one != other;
        let neighbours: Vec<Vec<usize>> =
            (0..32).map(|one| (0..32).filter(|&other| is_near(one, other)).collect()).collect();
        let order = nested_dissection(&places, &neighbours);
        let mut all = order.clone();
        all.sort_unstable();
        assert_eq!(all, (0..32).collect::<Vec<_>>(), "each node once");
        let separates = |node: &usize| order[*node] >= 28;
        let low = |node: &usize| order[*node] < 12;
        assert!((0..32).filter(separates).all(|node| places[node].x == 3.0), "{order:?}");
        assert!((0..32).filter(low).all(|node| places[node].x < 3.0), "{order:?}");
        assert!(nested_dissection(&[], &[]).is_empty());
    }
}

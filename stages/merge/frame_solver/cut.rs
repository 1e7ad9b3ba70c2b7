//! Minimum cut of a graph (Ford and Fulkerson, with the shortest augmenting paths of Edmonds and Karp).

use std::collections::VecDeque;

/// Capacity of an edge that must not be cut: more than any graph of robots has edges.
const FIRM: usize = usize::MAX / 4;

/// A graph of robots whose edges cost one each to cut, and two terminals: the robots on the side of `mover` move,
/// those on the side of `stayer` stay.
#[derive(Clone, Debug)]
pub(super) struct CutGraph {
    /// Arcs in pairs: the arc `index ^ 1` is the reverse one.
    arcs: Vec<Arc>,
    /// Outgoing arcs of each node.
    leaving: Vec<Vec<usize>>,
    mover: usize,
    stayer: usize,
}

#[derive(Clone, Copy, Debug)]
struct Arc {
    to: usize,
    capacity: usize,
    /// Residual capacity.
    residual: usize,
    /// Index of the caller's edge.
    edge: Option<usize>,
}

/// A minimum cut between the robots that move and those that stay.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LeastCut {
    /// Number of edges that are cut.
    pub(super) cost: usize,
    /// For every robot whether it moves; of several minimum cuts the one in which the fewest move.
    pub(super) moves: Vec<bool>,
    /// Edges that are in at least one minimum cut, by rising index.
    pub(super) edges_in_some_minimum_cut: Vec<usize>,
}

impl CutGraph {
    /// The graph of `robots` nodes and the edges `(index, a, b)`.
    pub(super) fn new(robots: usize, edges: impl Iterator<Item = (usize, usize, usize)>) -> Self {
        let mut graph =
            Self { arcs: Vec::new(), leaving: vec![Vec::new(); robots + 2], mover: robots, stayer: robots + 1 };
        for (index, a, b) in edges {
            graph.add(a, b, [1, 1], Some(index));
        }
        graph
    }

    fn add(&mut self, a: usize, b: usize, capacities: [usize; 2], edge: Option<usize>) {
        for (from, to, capacity) in [(a, b, capacities[0]), (b, a, capacities[1])] {
            self.leaving[from].push(self.arcs.len());
            self.arcs.push(Arc { to, capacity, residual: capacity, edge });
        }
    }

    /// Minimum cut when the robot `moves` is to move and `stays` is to stay, and each of `supporting_edges`, pairs of a
    /// robot that should move and one that should stay, costs one for either that does not. `None` if it costs more
    /// than `most`.
    pub(super) fn part(
        &mut self,
        moves: usize,
        stays: usize,
        supporting_edges: impl Iterator<Item = (usize, usize)>,
        most: usize,
    ) -> Option<LeastCut> {
        let arcs = self.arcs.len();
        let terminals =
            std::iter::once((moves, stays, FIRM)).chain(supporting_edges.map(|(moves, stays)| (moves, stays, 1)));
        for (moves, stays, capacity) in terminals {
            self.add(self.mover, moves, [capacity, 0], None);
            self.add(stays, self.stayer, [capacity, 0], None);
        }
        let cut = self.flow(most);
        for index in (arcs..self.arcs.len()).rev() {
            let from = self.arcs[index ^ 1].to;
            self.leaving[from].pop();
        }
        self.arcs.truncate(arcs);
        self.arcs.iter_mut().for_each(|arc| arc.residual = arc.capacity);
        cut
    }

    fn flow(&mut self, most: usize) -> Option<LeastCut> {
        let mut cost = 0;
        loop {
            let reached_by = self.reach(self.mover, Some(self.stayer));
            if reached_by[self.stayer].is_none() {
                let moves = reached_by[..self.mover].iter().map(Option::is_some).collect();
                return Some(LeastCut { cost, moves, edges_in_some_minimum_cut: self.edges_in_some_minimum_cut() });
            }
            let mut on_path = Vec::new();
            let mut node = self.stayer;
            while let Some(Some(arc)) = reached_by[node] {
                on_path.push(arc);
                node = self.arcs[arc ^ 1].to;
            }
            let least = on_path.iter().map(|&arc| self.arcs[arc].residual).min().unwrap_or(0);
            for arc in on_path {
                self.arcs[arc].residual -= least;
                self.arcs[arc ^ 1].residual += least;
            }
            cost += least;
            if cost > most || least == 0 {
                return None;
            }
        }
    }

    /// The nodes with residual capacity from `start`, each with its incoming arc: `Some(None)` is the start itself.
    fn reach(&self, start: usize, goal: Option<usize>) -> Vec<Option<Option<usize>>> {
        let mut reached_by = vec![None; self.leaving.len()];
        reached_by[start] = Some(None);
        let mut queue = VecDeque::from([start]);
        while let Some(node) = queue.pop_front() {
            for &index in &self.leaving[node] {
                let Arc { to, residual, .. } = self.arcs[index];
                if residual > 0 && reached_by[to].is_none() {
                    reached_by[to] = Some(Some(index));
                    if goal == Some(to) {
                        return reached_by;
                    }
                    queue.push_back(to);
                }
            }
        }
        reached_by
    }

    /// An edge is in some minimum cut if it has no residual capacity, neither directly nor on another path between
    /// its ends.
    fn edges_in_some_minimum_cut(&self) -> Vec<usize> {
        let mut found = Vec::new();
        for (index, arc) in self.arcs.iter().enumerate() {
            if let (Some(edge), 0) = (arc.edge, arc.residual)
                && self.reach(self.arcs[index ^ 1].to, Some(arc.to))[arc.to].is_none()
            {
                found.push(edge);
            }
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn graph(robots: usize, pairs: &[(usize, usize)]) -> CutGraph {
        CutGraph::new(robots, pairs.iter().enumerate().map(|(index, &(a, b))| (index, a, b)))
    }

    #[test]
    fn a_chain_is_cut_at_any_of_its_edges() {
        let cut = graph(4, &[(0, 1), (1, 2), (2, 3)]).part(3, 0, std::iter::empty(), 5).unwrap();
        assert_eq!(
            cut,
            LeastCut { cost: 1, moves: vec![false, false, false, true], edges_in_some_minimum_cut: vec![0, 1, 2] }
        );
    }

    #[test]
    fn a_supporting_edge_moves_the_cut() {
        let pairs = [(0, 1), (1, 2), (2, 3)];
        let cut = graph(4, &pairs).part(3, 0, [(1, 0)].into_iter(), 5).unwrap();
        assert_eq!((cut.cost, cut.edges_in_some_minimum_cut), (1, vec![0]));
    }

    #[test]
    fn a_cut_that_costs_too_much_is_none() {
        let pairs = [(0, 1), (1, 2), (0, 2)];
        let mut graph = graph(3, &pairs);
        assert_eq!(graph.part(1, 0, std::iter::empty(), 1), None);
        assert_eq!(graph.part(1, 0, std::iter::empty(), 2).unwrap().cost, 2, "calls are independent");
    }

    proptest! {
        #[test]
        fn no_way_to_part_them_is_cheaper(
            pairs in prop::collection::btree_set((0usize..7, 0usize..7), 1..18),
            supporting_edges in prop::collection::vec((0usize..7, 0usize..7), 0..4),
        ) {
            let pairs: Vec<(usize, usize)> = pairs.into_iter().filter(|(a, b)| a < b).collect();
            let cost = |sides: u32| {
                let moves = |robot: usize| sides >> robot & 1 == 1;
                let cut = pairs.iter().filter(|(a, b)| moves(*a) != moves(*b)).count();
                let denied = supporting_edges.iter().map(|&(m, s)| usize::from(!moves(m)) + usize::from(moves(s)));
                cut + denied.sum::<usize>()
            };
            let ways: Vec<u32> = (0..1 << 7).filter(|sides| sides & 0b11 == 0b10).collect();
            let least = ways.iter().map(|&sides| cost(sides)).min().unwrap();
            let cut = graph(7, &pairs).part(1, 0, supporting_edges.iter().copied(), 99).unwrap();
            prop_assert_eq!(cut.cost, least);
            let expected: Vec<usize> = (0..pairs.len())
                .filter(|&index| ways.iter().any(|&sides| {
                    let (a, b) = pairs[index];
                    cost(sides) == least && (sides >> a & 1) != (sides >> b & 1)
                }))
                .collect();
            prop_assert_eq!(cut.edges_in_some_minimum_cut, expected);
            let sides = cut.moves.iter().enumerate().map(|(robot, &moves)| u32::from(moves) << robot).sum::<u32>();
            prop_assert_eq!(cost(sides), least);
        }
    }
}

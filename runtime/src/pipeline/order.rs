//! The topological order of stages: each after those that feed it.

use petgraph::Direction;
use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Sorts the stages 0 to `count` topologically, such that each comes after those that feed it; ties are broken by
/// index. `edges` go from a stage to its readers.
///
/// # Errors
/// There are cycles: the shortest one of each strongly connected component, starting with its least stage, which is not
/// repeated at the end.
pub(super) fn order(count: usize, edges: &BTreeSet<(usize, usize)>) -> Result<Vec<usize>, Vec<Vec<usize>>> {
    let mut graph = DiGraph::with_capacity(count, edges.len());
    let nodes: Vec<NodeIndex> = (0..count).map(|_| graph.add_node(())).collect();
    let ends = |&(from, to): &(usize, usize)| Some((*nodes.get(from)?, *nodes.get(to)?));
    graph.extend_with_edges(edges.iter().filter_map(ends));
    let mut waiting: Vec<usize> =
        nodes.iter().map(|&stage| graph.neighbors_directed(stage, Direction::Incoming).count()).collect();
    let mut ready: BTreeSet<usize> = (0..count).filter(|&stage| waiting[stage] == 0).collect();
    let mut sorted = Vec::with_capacity(count);
    while let Some(stage) = ready.pop_first() {
        sorted.push(stage);
        for reader in readers(&graph, stage) {
            waiting[reader] -= 1;
            if waiting[reader] == 0 {
                ready.insert(reader);
            }
        }
    }
    if sorted.len() == count { Ok(sorted) } else { Err(cycles(&graph)) }
}

fn readers(graph: &DiGraph<(), ()>, stage: usize) -> BTreeSet<usize> {
    graph.neighbors(NodeIndex::new(stage)).map(NodeIndex::index).collect()
}

fn cycles(graph: &DiGraph<(), ()>) -> Vec<Vec<usize>> {
    let groups = tarjan_scc(graph).into_iter().map(|group| group.into_iter().map(NodeIndex::index).collect());
    let mut cycles: Vec<Vec<usize>> = groups.filter_map(|group| shortest_cycle(graph, &group)).collect();
    cycles.sort();
    cycles
}

/// The shortest cycle through the least stage of a strongly connected component.
fn shortest_cycle(graph: &DiGraph<(), ()>, group: &BTreeSet<usize>) -> Option<Vec<usize>> {
    let &start = group.first()?;
    let mut came_from = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(stage) = queue.pop_front() {
        let readers: BTreeSet<usize> = readers(graph, stage).intersection(group).copied().collect();
        if readers.contains(&start) {
            let mut cycle: Vec<usize> =
                std::iter::successors(Some(stage), |stage| came_from.get(stage).copied()).collect();
            cycle.reverse();
            return Some(cycle);
        }
        for reader in readers {
            if let Entry::Vacant(entry) = came_from.entry(reader) {
                entry.insert(stage);
                queue.push_back(reader);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_comes_after_those_that_feed_it_and_ties_are_broken_by_index() {
        let edges = BTreeSet::from([(3, 0), (3, 1), (0, 2), (1, 2)]);
        assert_eq!(order(5, &edges), Ok(vec![3, 0, 1, 2, 4]));
        assert_eq!(order(0, &BTreeSet::new()), Ok(vec![]));
    }

    #[test]
    fn every_cycle_is_found_without_the_stages_that_only_read_from_it() {
        let edges = BTreeSet::from([(0, 1), (1, 2), (2, 1), (2, 3), (5, 4), (4, 6), (6, 5)]);
        assert_eq!(order(7, &edges), Err(vec![vec![1, 2], vec![4, 6, 5]]));
    }

    #[test]
    fn the_shortest_cycle_is_reported() {
        let edges = BTreeSet::from([(0, 1), (1, 2), (2, 3), (3, 0), (1, 3)]);
        assert_eq!(order(4, &edges), Err(vec![vec![0, 1, 3]]));
    }
}

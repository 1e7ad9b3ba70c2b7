//! The smallest sets of alignments whose removal makes all cycles close, by trial.
//!
//! It finds all of them, but takes too long where there are many contradictions; `consensus` is for those.

use super::graph::{Cycle, Edge, Forest};
use std::collections::BTreeSet;

/// Bound of the work on one group of cycles: pose graphs times edges.
const MOST_WORK: usize = 100_000;

#[derive(Clone, Copy, PartialEq)]
enum Choice {
    Open,
    Kept,
    Removed,
}

/// Search for the smallest removals in one group of cycles: at least one edge of a contradicting cycle must be
/// removed, so each of them is tried in turn, to a depth that grows until a solution is found.
pub(super) struct Search<'a> {
    robots: usize,
    edges: &'a [Edge],
    group: &'a [usize],
    gate: f64,
    choices: Vec<Choice>,
    trials: usize,
    found: Vec<BTreeSet<usize>>,
}

impl<'a> Search<'a> {
    pub(super) fn new(robots: usize, edges: &'a [Edge], group: &'a [usize], gate: f64) -> Self {
        // Edges of other groups are ignored.
        let mut choices = vec![Choice::Removed; edges.len()];
        group.iter().for_each(|&index| choices[index] = Choice::Open);
        Self { robots, edges, group, gate, choices, trials: 0, found: Vec::new() }
    }

    /// The cycles that do not close with the present choices, the shortest first.
    pub(super) fn contradictions(&mut self) -> Vec<Cycle> {
        self.trials += 1;
        let in_use = |index: usize| self.choices[index] != Choice::Removed;
        let root = self.group.first().map_or(0, |&index| self.edges[index].a);
        let forest = Forest::grow(self.robots, self.edges, root, in_use);
        let closing = self.group.iter().filter(|&&index| in_use(index) && !forest.contains(index, &self.edges[index]));
        let mut cycles: Vec<Cycle> = closing
            .filter_map(|&index| forest.cycle(self.edges, index))
            .filter(|cycle| cycle.remainder.distance_from_identity() > self.gate)
            .collect();
        cycles.sort_by_key(|cycle| cycle.edges.len());
        cycles
    }

    /// All smallest sets of edges whose removal leaves no contradiction; none if the search takes too long. A set
    /// never has more than one edge for each of the `most` cycles that contradict at first.
    pub(super) fn smallest_removals(&mut self, most: usize) -> Vec<BTreeSet<usize>> {
        for size in 0..=most {
            self.descend(size);
            if self.is_over_budget() {
                return Vec::new();
            }
            if !self.found.is_empty() {
                break;
            }
        }
        std::mem::take(&mut self.found)
    }

    fn descend(&mut self, left: usize) {
        if self.is_over_budget() {
            return;
        }
        let contradictions = self.contradictions();
        let Some(shortest) = contradictions.first() else {
            self.found.push(self.removed());
            return;
        };
        // Contradictions without a common edge need one removal each.
        if count_disjoint(&contradictions) > left {
            return;
        }
        let open: Vec<usize> =
            shortest.edges.iter().copied().filter(|&index| self.choices[index] == Choice::Open).collect();
        for &index in &open {
            self.choices[index] = Choice::Removed;
            self.descend(left - 1);
            // The sets without this edge remain, so no set is found twice.
            self.choices[index] = Choice::Kept;
        }
        open.iter().for_each(|&index| self.choices[index] = Choice::Open);
    }

    fn is_over_budget(&self) -> bool {
        self.trials.saturating_mul(self.group.len()) > MOST_WORK
    }

    fn removed(&self) -> BTreeSet<usize> {
        self.group.iter().copied().filter(|&index| self.choices[index] == Choice::Removed).collect()
    }
}

/// Number of cycles without a common edge that can be picked, in order.
pub(super) fn count_disjoint(cycles: &[Cycle]) -> usize {
    let mut taken = BTreeSet::new();
    let mut count = 0;
    for cycle in cycles {
        if cycle.edges.iter().all(|edge| !taken.contains(edge)) {
            taken.extend(cycle.edges.iter().copied());
            count += 1;
        }
    }
    count
}

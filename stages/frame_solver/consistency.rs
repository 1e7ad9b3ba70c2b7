//! Which alignments contradict each other, and which of them are wrong.
//!
//! The transforms along a cycle of alignments multiply to the identity, up to their covariances, when all of them are
//! right. Where they do not, some alignment of the cycle is wrong. It can be told which one only if other cycles vouch
//! for the rest: the smallest sets of alignments whose removal makes all cycles agree are found, and an alignment
//! counts as wrong if it is in all of those sets, as right if it is in none, and as **disputed** otherwise. In a lone
//! triangle that does not close, all three are disputed.
//!
//! Alignments that are in no cycle cannot be checked and count as right. Cycles that share no alignment are judged
//! apart from each other. Where there are many contradictions, alignments that many triangles speak against are taken
//! out first, see `votes.rs`.

use super::graph::{Cycle, Edge, Forest};
use super::votes::outvoted;
use std::collections::{BTreeMap, BTreeSet};

/// Contradictions apart from each other beyond which alignments may be outvoted before the search.
const SEARCHED_DEPTH: usize = 3;
/// How much is tried for one group of cycles before all its alignments are called disputed: pose graphs times edges.
const MOST_WORK: usize = 400_000;

/// What the cycles say of one alignment.
#[derive(Clone, Debug)]
pub enum Verdict {
    /// It agrees with every cycle it is in.
    Right,
    /// It contradicts the others, which agree with each other. The cycle is one that it closes with them.
    Wrong(Cycle),
    /// It is part of a contradiction, and nothing tells which part is wrong. The cycle shows the contradiction.
    Disputed(Cycle),
}

/// Judges every edge. A cycle contradicts if it is more than `gate` standard deviations from closing.
pub fn judge(robots: usize, edges: &[Edge], gate: f64) -> Vec<Verdict> {
    let mut verdicts = vec![Verdict::Right; edges.len()];
    let forest = Forest::grow(robots, edges, 0, |_| true);
    let closing = (0..edges.len()).filter(|&index| !forest.contains(index, &edges[index]));
    let cycles: Vec<Cycle> = closing.filter_map(|index| forest.cycle(edges, index)).collect();
    if cycles.iter().all(|cycle| cycle.remainder.distance_from_identity() <= gate) {
        return verdicts;
    }
    for group in groups_of_cycles(&cycles, edges.len()) {
        let mut search = Search::new(robots, edges, &group, gate);
        let contradictions = search.contradictions();
        if contradictions.is_empty() {
            continue;
        }
        if count_disjoint(&contradictions) > SEARCHED_DEPTH {
            outvoted(edges, &group, gate).into_iter().for_each(|index| search.choices[index] = Choice::Removed);
        }
        let removals = search.smallest_removals(contradictions.len());
        let in_all = |edge: &usize| !removals.is_empty() && removals.iter().all(|set| set.contains(edge));
        let in_none = |edge: &usize| !removals.is_empty() && !removals.iter().any(|set| set.contains(edge));
        let right: BTreeSet<usize> = group.iter().copied().filter(in_none).collect();
        let forest = Forest::grow(robots, edges, 0, |index| right.contains(&index));
        for &index in group.iter().filter(|index| !right.contains(index)) {
            let shown = contradictions.iter().find(|cycle| cycle.edges.contains(&index)).or(contradictions.first());
            verdicts[index] = match (in_all(&index), forest.cycle(edges, index), shown) {
                (true, Some(cycle), _) => Verdict::Wrong(cycle),
                (_, _, Some(cycle)) => Verdict::Disputed(cycle.clone()),
                (_, _, None) => Verdict::Right,
            };
        }
    }
    verdicts
}

/// The edges that lie on cycles, in groups: two edges are in one group if a cycle goes through both (the biconnected
/// components of the graph). Each group by rising index.
///
/// `cycles` are those that the edges outside of a spanning forest close; joining the edges of each gives the groups.
fn groups_of_cycles(cycles: &[Cycle], edge_count: usize) -> Vec<Vec<usize>> {
    let mut leader: Vec<usize> = (0..edge_count).collect();
    let mut on_cycle = BTreeSet::new();
    for cycle in cycles {
        for (&one, &next) in cycle.edges.iter().zip(cycle.edges.iter().skip(1)) {
            on_cycle.extend([one, next]);
            let (one, next) = (find(&mut leader, one), find(&mut leader, next));
            leader[one.max(next)] = one.min(next);
        }
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for index in on_cycle {
        groups.entry(find(&mut leader, index)).or_default().push(index);
    }
    groups.into_values().collect()
}

/// The leader of a set, with path halving.
fn find(leader: &mut [usize], mut member: usize) -> usize {
    while leader[member] != member {
        leader[member] = leader[leader[member]];
        member = leader[member];
    }
    member
}

#[derive(Clone, Copy, PartialEq)]
enum Choice {
    Open,
    Kept,
    Removed,
}

/// The search for the smallest removals in one group of cycles: at least one edge of a contradicting cycle has to go,
/// so each of them is tried in turn, to a depth that grows until something is found.
struct Search<'a> {
    robots: usize,
    edges: &'a [Edge],
    group: &'a [usize],
    gate: f64,
    choices: Vec<Choice>,
    trials: usize,
    found: Vec<BTreeSet<usize>>,
}

impl<'a> Search<'a> {
    fn new(robots: usize, edges: &'a [Edge], group: &'a [usize], gate: f64) -> Self {
        // Edges of other groups stay out of it.
        let mut choices = vec![Choice::Removed; edges.len()];
        group.iter().for_each(|&index| choices[index] = Choice::Open);
        Self { robots, edges, group, gate, choices, trials: 0, found: Vec::new() }
    }

    /// The cycles that do not close with the present choices, the shortest first.
    fn contradictions(&mut self) -> Vec<Cycle> {
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

    /// All smallest sets of edges whose removal leaves no contradiction; none if the search takes too long. There is
    /// never a set with more than one edge for each of the `most` cycles that contradict at first.
    fn smallest_removals(&mut self, most: usize) -> Vec<BTreeSet<usize>> {
        for size in 0..=most {
            self.descend(size);
            if self.is_tired() {
                return Vec::new();
            }
            if !self.found.is_empty() {
                break;
            }
        }
        std::mem::take(&mut self.found)
    }

    fn descend(&mut self, left: usize) {
        if self.is_tired() {
            return;
        }
        let contradictions = self.contradictions();
        let Some(shortest) = contradictions.first() else {
            self.found.push(self.removed());
            return;
        };
        // Contradictions that share no edge need a removal each.
        if count_disjoint(&contradictions) > left {
            return;
        }
        let open: Vec<usize> =
            shortest.edges.iter().copied().filter(|&index| self.choices[index] == Choice::Open).collect();
        for &index in &open {
            self.choices[index] = Choice::Removed;
            self.descend(left - 1);
            // The sets without this edge remain; so no set is found twice.
            self.choices[index] = Choice::Kept;
        }
        open.iter().for_each(|&index| self.choices[index] = Choice::Open);
    }

    fn is_tired(&self) -> bool {
        self.trials.saturating_mul(self.group.len()) > MOST_WORK
    }

    fn removed(&self) -> BTreeSet<usize> {
        self.group.iter().copied().filter(|&index| self.choices[index] == Choice::Removed).collect()
    }
}

fn count_disjoint(cycles: &[Cycle]) -> usize {
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

#[cfg(test)]
mod tests {
    use super::super::UncertainPose;
    use super::*;
    use crate::geometry::{Pose2, pose};
    use nalgebra::Matrix3;

    /// Robots on a spiral, and edges between them; those in `wrong` are off by two metres.
    fn edges(pairs: &[(usize, usize)], wrong: &[(usize, usize)]) -> Vec<Edge> {
        let place = |robot: usize| pose(3.0 * robot as f64, (robot * robot) as f64, robot as f64);
        let edge = |(nth, &(a, b)): (usize, &(usize, usize))| {
            let error = match wrong.contains(&(a, b)) {
                true => pose(2.0 + nth as f64, 0.0, 0.0),
                false => Pose2::identity(),
            };
            let pose = place(a).inverse() * place(b) * error;
            Edge { a, b, transform_a_b: UncertainPose { pose, covariance: Matrix3::identity() * 1e-3 } }
        };
        pairs.iter().enumerate().map(edge).collect()
    }

    /// `.` right, `x` wrong, `?` disputed.
    fn verdicts(robots: usize, pairs: &[(usize, usize)], wrong: &[(usize, usize)]) -> String {
        let letter = |verdict: &Verdict| match verdict {
            Verdict::Right => '.',
            Verdict::Wrong(_) => 'x',
            Verdict::Disputed(_) => '?',
        };
        judge(robots, &edges(pairs, wrong), 4.0).iter().map(letter).collect()
    }

    fn complete(robots: usize) -> Vec<(usize, usize)> {
        (0..robots).flat_map(|a| (a + 1..robots).map(move |b| (a, b))).collect()
    }

    #[test]
    fn a_lone_triangle_that_does_not_close_is_disputed() {
        assert_eq!(verdicts(3, &complete(3), &[]), "...");
        assert_eq!(verdicts(3, &complete(3), &[(1, 2)]), "???");
    }

    #[test]
    fn one_wrong_alignment_among_four_robots_is_found() {
        let pairs = complete(4);
        for wrong in &pairs {
            let expected: String = pairs.iter().map(|pair| if pair == wrong { 'x' } else { '.' }).collect();
            assert_eq!(verdicts(4, &pairs, &[*wrong]), expected);
        }
    }

    #[test]
    fn a_shared_side_tells_which_triangle_is_wrong_but_not_which_side_of_it() {
        let pairs = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)];
        assert_eq!(verdicts(4, &pairs, &[(1, 3)]), "...??");
        assert_eq!(verdicts(4, &pairs, &[(1, 2)]), "..x..");
    }

    #[test]
    fn a_ring_is_checked_though_it_has_no_triangle() {
        let pairs = [(0, 1), (1, 2), (2, 3), (0, 3)];
        assert_eq!(verdicts(4, &pairs, &[]), "....");
        assert_eq!(verdicts(4, &pairs, &[(2, 3)]), "????");
    }

    #[test]
    fn cycles_that_share_no_alignment_are_judged_apart() {
        let pairs = [(0, 1), (0, 2), (1, 2), (2, 3), (3, 4), (3, 5), (4, 5), (5, 6)];
        assert_eq!(verdicts(7, &pairs, &[(3, 4)]), "....???.");
    }

    #[test]
    fn many_wrong_alignments_among_many_robots_are_found() {
        let pairs = complete(24);
        let wrong: Vec<_> = pairs.iter().copied().filter(|(a, b)| (a * 5 + b * 3) % 17 == 0).collect();
        assert!(wrong.len() > 10);
        let expected: String = pairs.iter().map(|pair| if wrong.contains(pair) { 'x' } else { '.' }).collect();
        assert_eq!(verdicts(24, &pairs, &wrong), expected);
    }

    #[test]
    fn a_tangle_that_takes_too_long_is_disputed() {
        let pairs = complete(9);
        let wrong: Vec<_> = pairs.iter().copied().filter(|(a, b)| (a + b) % 5 != 0).collect();
        assert_eq!(verdicts(9, &pairs, &wrong), "?".repeat(pairs.len()));
    }
}

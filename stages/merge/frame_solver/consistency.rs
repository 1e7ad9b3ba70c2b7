//! Finds alignments that contradict each other, and which of them are wrong.
//!
//! The transforms along a cycle of alignments multiply to the identity, up to their covariances, when all of them are
//! right. Where they do not, some alignment of the cycle is wrong. Which one can be decided only if other cycles
//! confirm the rest: the smallest sets of alignments whose removal makes all cycles agree are found, and an alignment
//! counts as wrong if it is in all of those sets, as right if it is in none, and as **disputed** otherwise. In a lone
//! triangle that does not close, all three are disputed. Where two wrong alignments of a robot agree with each other,
//! and two right ones do, all four are; but two that agree outweigh one.
//!
//! Alignments that are in no cycle cannot be checked and count as right. Cycles without a common alignment are judged
//! independently. Where there are few contradictions all sets are tried (`search`), else the largest set of
//! alignments that agree is sought by moves, and alternatives are disputed (`consensus`).
//!
//! Scores are not used: those of different methods are not comparable. Nor are small covariances evidence for an
//! alignment: they are its accuracy if it is right, not the probability that it is.

use super::consensus::EdgeConsensus;
use super::graph::{Cycle, Edge, Forest, Neighbours};
use super::search::{Search, count_disjoint};
use std::collections::{BTreeMap, BTreeSet};

/// Number of disjoint contradictions above which not all sets are tried.
const SEARCHED_DEPTH: usize = 6;

/// Verdict of the cycles on one alignment.
#[derive(Clone, Debug)]
pub enum EdgeVerdict {
    /// It agrees with every cycle it is in.
    Right,
    /// It contradicts the others, which agree with each other. The cycle is one that it closes with them.
    Wrong(Cycle),
    /// It is part of a contradiction, and the evidence does not decide which part is wrong. The cycle shows the
    /// contradiction.
    Disputed(Cycle),
}

/// Judges every edge. A cycle contradicts if its Mahalanobis distance from the identity is above `gate`.
///
/// `known` marks edges that were right when the rest was judged before: they agree with each other. It saves work,
/// and may mark none.
pub fn judge(robots: usize, edges: &[Edge], known: &[bool], gate: f64) -> Vec<EdgeVerdict> {
    let mut verdicts = vec![EdgeVerdict::Right; edges.len()];
    let neighbours = Neighbours::new(robots, edges);
    let is_open = |cycle: &Cycle| cycle.remainder.distance_from_identity() > gate;
    // A long cycle may hide what a short one shows.
    let unknown = (0..edges.len()).filter(|&index| !known[index]);
    let open: BTreeSet<usize> = unknown
        .filter(|&index| neighbours.cycle(edges, index, |_| true).is_some_and(|cycle| is_open(&cycle)))
        .collect();
    let forest = Forest::grow(robots, edges, 0, |_| true);
    let closing = (0..edges.len()).filter(|&index| !forest.contains(index, &edges[index]));
    let cycles: Vec<Cycle> = closing.filter_map(|index| forest.cycle(edges, index)).collect();
    if open.is_empty() && !cycles.iter().any(is_open) {
        return verdicts;
    }
    for group in groups_of_cycles(&cycles, edges.len()) {
        let mut search = Search::new(robots, edges, &group, gate);
        let contradictions = search.contradictions();
        if contradictions.is_empty() && !group.iter().any(|index| open.contains(index)) {
            continue;
        }
        let depth = count_disjoint(&contradictions);
        let removals = match depth {
            1..=SEARCHED_DEPTH => search.smallest_removals(contradictions.len()),
            _ => Vec::new(),
        };
        if removals.is_empty() {
            judge_by_moves(robots, edges, known, gate, &group, &mut verdicts);
            continue;
        }
        let right: BTreeSet<usize> =
            group.iter().copied().filter(|edge| !removals.iter().any(|set| set.contains(edge))).collect();
        for &index in group.iter().filter(|index| !right.contains(index)) {
            let shown = contradictions.iter().find(|cycle| cycle.edges.contains(&index)).or(contradictions.first());
            let is_in_all = removals.iter().all(|set| set.contains(&index));
            verdicts[index] = match (is_in_all, neighbours.cycle(edges, index, |index| right.contains(&index)), shown) {
                (true, Some(cycle), _) => EdgeVerdict::Wrong(cycle),
                (_, _, Some(cycle)) => EdgeVerdict::Disputed(cycle.clone()),
                (_, _, None) => EdgeVerdict::Right,
            };
        }
    }
    verdicts
}

/// Judges a group of edges that share cycles, with any number of contradictions.
fn judge_by_moves(
    robots: usize,
    edges: &[Edge],
    known: &[bool],
    gate: f64,
    group: &[usize],
    verdicts: &mut [EdgeVerdict],
) {
    let own: Vec<Edge> = group.iter().map(|&index| edges[index]).collect();
    let known = group.iter().map(|&index| known[index]).collect();
    let neighbours = Neighbours::new(robots, &own);
    let consensus = EdgeConsensus::find(robots, &own, &neighbours, known, gate);
    let disputed = consensus.disputed();
    let is_right = |index: usize| consensus.contains(index) && !disputed.contains_key(&index);
    let in_all_edges = |cycle: Cycle| Cycle {
        edges: cycle.edges.iter().map(|&index| group[index]).collect(),
        remainder: cycle.remainder,
    };
    for (index, &place) in group.iter().enumerate().filter(|(index, _)| !is_right(*index)) {
        verdicts[place] = match disputed.get(&index) {
            Some(cycle) => EdgeVerdict::Disputed(in_all_edges(cycle.clone())),
            None => match neighbours.cycle(&own, index, is_right) {
                Some(cycle) => EdgeVerdict::Wrong(in_all_edges(cycle)),
                None => EdgeVerdict::Right,
            },
        };
    }
}

/// The edges on cycles, in groups: two edges are in one group if a cycle contains both (the biconnected components of
/// the graph). Each group by rising index.
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

/// The representative of a set, with path halving.
fn find(leader: &mut [usize], mut member: usize) -> usize {
    while leader[member] != member {
        leader[member] = leader[leader[member]];
        member = leader[member];
    }
    member
}

#[cfg(test)]
mod tests {
    use super::super::UncertainPose;
    use super::super::simulated_graph::SimulatedGraph;
    use super::*;
    use crate::shared::geometry::{Pose2, pose};
    use nalgebra::Matrix3;
    use proptest::prelude::*;

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

    fn judge_all(robots: usize, edges: &[Edge]) -> Vec<EdgeVerdict> {
        judge(robots, edges, &vec![false; edges.len()], 4.0)
    }

    /// `.` right, `x` wrong, `?` disputed.
    fn verdicts(robots: usize, pairs: &[(usize, usize)], wrong: &[(usize, usize)]) -> String {
        letters(&judge_all(robots, &edges(pairs, wrong)))
    }

    fn letters(verdicts: &[EdgeVerdict]) -> String {
        let letter = |verdict: &EdgeVerdict| match verdict {
            EdgeVerdict::Right => '.',
            EdgeVerdict::Wrong(_) => 'x',
            EdgeVerdict::Disputed(_) => '?',
        };
        verdicts.iter().map(letter).collect()
    }

    fn complete(robots: usize) -> Vec<(usize, usize)> {
        (0..robots).flat_map(|a| (a + 1..robots).map(move |b| (a, b))).collect()
    }

    #[test]
    fn a_shared_side_shows_which_triangle_is_wrong_but_not_which_side_of_it() {
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

    /// The same letters by trying all sets of edges.
    fn verdicts_by_trial(robots: usize, edges: &[Edge]) -> String {
        let agrees = |set: u32| {
            let used = |index: usize| set >> index & 1 == 1;
            let poses = Forest::grow(robots, edges, 0, used).poses_by_tree(edges);
            edges.iter().enumerate().filter(|(index, _)| used(*index)).all(|(_, edge)| {
                let off = poses[edge.a].pose.inverse() * poses[edge.b].pose * edge.transform_a_b.pose.inverse();
                off.translation.vector.norm() < 0.01 && off.rotation.angle().abs() < 0.01
            })
        };
        let sets: Vec<u32> = (0..1 << edges.len()).filter(|&set| agrees(set)).collect();
        let most = sets.iter().map(|set| set.count_ones()).max().unwrap();
        let largest = || sets.iter().filter(|set| set.count_ones() == most);
        let letter = |index: usize| match largest().filter(|&set| set >> index & 1 == 1).count() {
            0 => 'x',
            count if count == largest().count() => '.',
            _ => '?',
        };
        (0..edges.len()).map(letter).collect()
    }

    proptest! {
        #[test]
        fn the_verdicts_on_few_robots_are_those_of_all_sets(
            robots in 3usize..=5,
            steps in prop::collection::vec(0u8..12, 10),
        ) {
            // Errors are steps in the frame of the building, so that they often agree with each other.
            let error = |index: usize| pose(2.0 * f64::from(steps[index].saturating_sub(8)), 0.0, 0.0);
            let place = |robot: usize| pose(3.0 * robot as f64, (robot * robot) as f64, robot as f64);
            let edge = |(index, (a, b)): (usize, (usize, usize))| {
                let pose = place(a).inverse() * error(index) * place(b);
                Edge { a, b, transform_a_b: UncertainPose { pose, covariance: Matrix3::identity() * 1e-6 } }
            };
            let edges: Vec<Edge> = complete(robots).into_iter().enumerate().map(edge).collect();
            let (judged, expected) = (letters(&judge_all(robots, &edges)), verdicts_by_trial(robots, &edges));
            for (judged, expected) in judged.chars().zip(expected.chars()) {
                prop_assert_eq!(judged == '.', expected == '.');
                // An edge that no right path bypasses is disputed, though it is in none of the largest sets.
                prop_assert!(judged != 'x' || expected == 'x');
            }
        }
    }

    #[test]
    fn a_component_that_takes_too_long_is_disputed() {
        let pairs = complete(9);
        let wrong: Vec<_> = pairs.iter().copied().filter(|(a, b)| (a + b) % 5 != 0).collect();
        assert_eq!(verdicts(9, &pairs, &wrong), "?".repeat(pairs.len()));
    }

    #[test]
    fn among_many_robots_with_many_outliers_no_wrong_alignment_counts_as_right() {
        let simulated = SimulatedGraph::new(32, 6, 3).with_outliers(0.2);
        let verdicts = judge_all(32, &simulated.edges);
        assert!(simulated.wrong.iter().all(|&index| !matches!(verdicts[index], EdgeVerdict::Right)));
        let right = verdicts.iter().filter(|verdict| matches!(verdict, EdgeVerdict::Right)).count();
        assert!(
            right > 70 * (simulated.edges.len() - simulated.wrong.len()) / 100,
            "{right} of {}",
            simulated.edges.len()
        );
    }

    #[test]
    fn two_wrong_alignments_that_agree_are_outweighed_by_more_right_ones() {
        for seed in 0..20 {
            let simulated = SimulatedGraph::new(10, 9, seed).with_agreeing_outliers(0.1);
            assert_eq!(simulated.wrong.len(), 4);
            for (index, verdict) in judge_all(10, &simulated.edges).iter().enumerate() {
                assert_eq!(
                    matches!(verdict, EdgeVerdict::Wrong(_)),
                    simulated.wrong.contains(&index),
                    "{seed} {index}"
                );
            }
        }
    }
}

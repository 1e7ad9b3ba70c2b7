//! Which alignments contradict each other, and which of them are wrong.
//!
//! The transforms along a cycle of alignments multiply to the identity, up to their covariances, when all of them are
//! right. Where they do not, some alignment of the cycle is wrong. It can be told which one only if other cycles vouch
//! for the rest: an alignment counts as right if it is in every largest set of alignments that agree with each other
//! (see `consensus`), as wrong if it is in none, and as **disputed** otherwise. In a lone triangle that does not close,
//! all three are disputed. So are two wrong alignments of a robot that agree with each other, and two right ones; but
//! two that agree outweigh one.
//!
//! Alignments that are in no cycle cannot be checked and count as right. Scores are not weighed: those of different
//! methods do not compare, and the covariances say how exact an alignment is if it is right, not whether it is.

use super::consensus::{Consensus, Moves};
use super::graph::{Cycle, Edge, Neighbours};
use std::collections::BTreeMap;

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
    let neighbours = Neighbours::new(robots, edges);
    let consensus = Consensus::find(robots, edges, &neighbours, gate);
    let outside = consensus.outside();
    let disputed = dispute(&consensus, edges, &neighbours, &outside);
    let is_right = |index: usize| consensus.contains(index) && !disputed.contains_key(&index);
    let verdict = |index: usize| match disputed.get(&index) {
        Some(cycle) => Verdict::Disputed(cycle.clone()),
        None if consensus.contains(index) => Verdict::Right,
        None => neighbours.cycle(edges, index, is_right).map_or(Verdict::Right, Verdict::Wrong),
    };
    (0..edges.len()).map(verdict).collect()
}

/// The edges of which it cannot be told whether they are right, with a cycle that shows the contradiction.
///
/// An edge outside of the set is disputed if following it loses no more than it wins, and so is what it may cost. What
/// is disputed vouches for nothing, so the rest is looked at again without it.
fn dispute(
    consensus: &Consensus<'_>,
    edges: &[Edge],
    neighbours: &Neighbours,
    outside: &[usize],
) -> BTreeMap<usize, Cycle> {
    let mut disputed: BTreeMap<usize, Cycle> = BTreeMap::new();
    loop {
        let before = disputed.len();
        let mut moves = Moves::new(consensus, |index| !disputed.contains_key(&index));
        for &index in outside {
            if disputed.contains_key(&index) {
                continue;
            }
            let Some(cut) = moves.follow(index, outside).lost else { continue };
            let Some(cycle) = neighbours.cycle(edges, index, |index| consensus.contains(index)) else { continue };
            for lost in std::iter::once(index).chain(cut.in_some_cut) {
                disputed.entry(lost).or_insert_with(|| cycle.clone());
            }
        }
        if disputed.len() == before {
            return disputed;
        }
    }
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

//! The largest set of alignments that agree with each other.
//!
//! A set agrees if each of its edges closes the shortest cycle that it makes with the others, up to the covariances.
//! The largest one is sought by moves, each of which changes the pose of any number of robots at once. An edge
//! outside of the set implies a move of the robots at one of its ends relative to those at the other, and other edges
//! outside may agree with that. The best set of robots to move is a minimum cut: an edge of the set between a robot
//! that moves and one that stays is lost, an edge outside that agrees with the move is won. A move that wins more
//! than it loses is made; a move that wins as much as it loses shows that the evidence does not decide between the
//! two (`consistency`).
//!
//! Moves by which all robots that move stay together suffice, unless wrong alignments close cycles among themselves
//! by chance. For let another solution split a set in which no robot depends on one edge alone into k + 1 pieces that
//! move apart: it loses at least k + 1 edges, and k edges suffice to connect the pieces in another way. What it wins
//! beyond these k agrees with them, as two edges between the same pieces do, which one move wins together.

use super::cut::{CutGraph, LeastCut};
use super::graph::{Cycle, Edge, Forest, Neighbours};
use super::uncertain::UncertainPose;
use crate::shared::geometry::wrap_angle;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Number of the triangles of an edge that are tested to find the edges that agree most.
const WITNESSES: usize = 8;

/// A set of edges that agree with each other.
pub(super) struct Consensus<'a> {
    robots: usize,
    edges: &'a [Edge],
    neighbours: &'a Neighbours,
    gate: f64,
    /// For every edge whether it is in the set.
    agrees: Vec<bool>,
}

/// Gain and loss of an edge outside of the set.
struct Move {
    /// Number of edges outside that agree with it, including itself.
    won: usize,
    /// Loss if it is followed. `None` if that is more than the gain.
    lost: Option<LeastCut>,
}

impl<'a> Consensus<'a> {
    /// Finds a set that no move enlarges, from edges that are known to agree. A cycle is closed if its Mahalanobis
    /// distance from the identity is within `gate`.
    pub(super) fn find(
        robots: usize,
        edges: &'a [Edge],
        neighbours: &'a Neighbours,
        known: Vec<bool>,
        gate: f64,
    ) -> Self {
        let mut consensus = Self { robots, edges, neighbours, gate, agrees: known };
        let mut order: Vec<usize> = (0..edges.len()).collect();
        // Edges that close triangles are most likely right, and a good start needs few moves.
        let closing: Vec<usize> = order
            .iter()
            .map(|&index| if consensus.agrees[index] { 0 } else { consensus.closing_triangles(index) })
            .collect();
        let spread = |index: usize| edges[index].transform_a_b.spread();
        order.sort_by(|&i, &j| {
            Reverse(closing[i]).cmp(&Reverse(closing[j])).then(spread(i).total_cmp(&spread(j))).then(i.cmp(&j))
        });
        consensus.extend(&order);
        while consensus.make_a_move(&order) {}
        consensus
    }

    /// Whether the edge is in the set.
    pub(super) fn contains(&self, index: usize) -> bool {
        self.agrees[index]
    }

    fn outside(&self) -> Vec<usize> {
        (0..self.edges.len()).filter(|&index| !self.agrees[index]).collect()
    }

    /// Edges that are disputed, with a cycle that shows the contradiction.
    ///
    /// An edge outside of the set is disputed if following it loses no more than it wins, and so are the edges that
    /// it may lose. Disputed edges are no evidence for others, so the rest is checked again without them.
    pub(super) fn disputed(&self) -> BTreeMap<usize, Cycle> {
        let outside = self.outside();
        let mut disputed: BTreeMap<usize, Cycle> = BTreeMap::new();
        loop {
            let before = disputed.len();
            let mut moves = Moves::new(self, |index| self.agrees[index] && !disputed.contains_key(&index));
            for &index in &outside {
                if disputed.contains_key(&index) {
                    continue;
                }
                let Some(cut) = moves.follow(index, &outside).lost else { continue };
                let Some(cycle) = self.neighbours.cycle(self.edges, index, |index| self.agrees[index]) else {
                    continue;
                };
                for lost in std::iter::once(index).chain(cut.in_some_cut) {
                    disputed.entry(lost).or_insert_with(|| cycle.clone());
                }
            }
            if disputed.len() == before {
                return disputed;
            }
        }
    }

    /// Number of triangles that an edge closes, of the first few that it is in.
    fn closing_triangles(&self, index: usize) -> usize {
        let Edge { a, b, transform_a_b } = self.edges[index];
        let mut side_of_b = vec![None; self.robots];
        for &side in self.neighbours.of(b) {
            side_of_b[self.edges[side].other(b)] = Some(side);
        }
        let sides = self.neighbours.of(a).iter().filter(|&&side| side != index);
        let triangles = sides.filter_map(|&side_a| Some((side_a, side_of_b[self.edges[side_a].other(a)]?)));
        let closes = |&(side_a, side_b): &(usize, usize)| {
            let third = self.edges[side_a].other(a);
            let round = transform_a_b
                .then(&self.edges[side_b].transform_from(b))
                .then(&self.edges[side_a].transform_from(third));
            round.distance_from_identity() <= self.gate
        };
        triangles.take(WITNESSES).filter(closes).count()
    }

    /// Adds every edge that agrees with the set, in the order given.
    fn extend(&mut self, order: &[usize]) {
        for &index in order {
            if !self.agrees[index] {
                let cycle = self.neighbours.cycle(self.edges, index, |index| self.agrees[index]);
                self.agrees[index] = cycle.is_none_or(|cycle| cycle.remainder.distance_from_identity() <= self.gate);
            }
        }
    }

    /// Makes the first move that wins more than it loses. Returns whether there was one.
    fn make_a_move(&mut self, order: &[usize]) -> bool {
        let outside = self.outside();
        let mut moves = Moves::new(self, |index| self.agrees[index]);
        for &index in &outside {
            let one = moves.follow(index, &outside);
            let Some(cut) = one.lost.filter(|cut| cut.cost < one.won) else { continue };
            let before = self.agrees.clone();
            for (agrees, edge) in self.agrees.iter_mut().zip(self.edges) {
                *agrees &= cut.moves[edge.a] == cut.moves[edge.b];
            }
            self.extend(&[index]);
            self.extend(order);
            let count = |agrees: &[bool]| agrees.iter().filter(|agrees| **agrees).count();
            if count(&self.agrees) > count(&before) {
                return true;
            }
            self.agrees = before;
        }
        false
    }
}

/// Gains and losses of moves of robots, over a part of a set of edges that agree.
struct Moves<'a> {
    edges: &'a [Edge],
    gate: f64,
    forest: Forest,
    /// `T_root_robot` and the root, for every robot.
    placed: Vec<UncertainPose>,
    graph: CutGraph,
}

impl<'a> Moves<'a> {
    /// The moves over those edges of the set for which `used` holds. The poses are those of the whole set.
    fn new(consensus: &Consensus<'a>, used: impl Fn(usize) -> bool) -> Self {
        let Consensus { robots, edges, gate, .. } = *consensus;
        let forest = Forest::grow(robots, edges, 0, |index| consensus.agrees[index]);
        let placed = forest.poses_by_tree(edges);
        let in_use = edges.iter().enumerate().filter(|(index, _)| used(*index));
        let graph = CutGraph::new(robots, in_use.map(|(index, edge)| (index, edge.a, edge.b)));
        Self { edges, gate, forest, placed, graph }
    }

    /// Gain and loss when robot b of an edge outside of the set moves so that the edge agrees, while robot a stays.
    fn follow(&mut self, index: usize, outside: &[usize]) -> Move {
        let Edge { a: stays, b: moved, transform_a_b: transform_stays_moved } = self.edges[index];
        let mut wishes = Vec::new();
        for &other in outside.iter().filter(|&&other| other != index) {
            let Edge { a, b, .. } = self.edges[other];
            for (other_moved, other_stays) in [(b, a), (a, b)] {
                if self.agree(&transform_stays_moved, [moved, stays], other, [other_moved, other_stays]) {
                    wishes.push((other_moved, other_stays));
                }
            }
        }
        let won = wishes.len() + 1;
        Move { won, lost: self.graph.part(moved, stays, wishes.into_iter(), won) }
    }

    /// Whether two edges outside imply the same move of the robots at one end relative to those at the other.
    fn agree(
        &self,
        transform_stays_moved: &UncertainPose,
        [moved, stays]: [usize; 2],
        other: usize,
        [other_moved, other_stays]: [usize; 2],
    ) -> bool {
        let transform_other = self.edges[other].transform_from(other_moved);
        // Comparing the angles first rejects most pairs, and costs little.
        let turn = |robot: usize| self.placed[robot].pose.rotation.angle();
        let angle = transform_stays_moved.pose.rotation.angle() + turn(other_moved) - turn(moved)
            + transform_other.pose.rotation.angle()
            + turn(stays)
            - turn(other_stays);
        let ends = [moved, stays, other_moved, other_stays].map(|robot| self.placed[robot].covariance[(2, 2)]);
        let variance =
            ends.iter().sum::<f64>() + transform_stays_moved.covariance[(2, 2)] + transform_other.covariance[(2, 2)];
        if wrap_angle(angle).powi(2) > self.gate.powi(2) * variance {
            return false;
        }
        let path = |from, to| self.forest.path(self.edges, from, to);
        let (Some((_, by_moved)), Some((_, by_stays))) = (path(moved, other_moved), path(other_stays, stays)) else {
            return false;
        };
        let round = transform_stays_moved.then(&by_moved).then(&transform_other).then(&by_stays);
        round.distance_from_identity() <= self.gate
    }
}

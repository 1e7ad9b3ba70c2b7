//! The largest set of alignments that agree with each other.
//!
//! A set agrees if each of its edges closes the shortest cycle that it makes with the others, up to the covariances.
//! The largest one is sought by relocations, each of which changes the pose of any number of robots at once. An edge
//! outside of the set implies a relocation of the robots at one of its ends relative to those at the other, and other
//! edges outside may support that. The best set of robots to move is a minimum cut: an edge of the set between a robot
//! that moves and one that stays is a cost, an edge outside that supports the relocation is a gain. A relocation whose
//! gain exceeds its cost is made; one whose gain equals its cost shows that the evidence does not decide between the
//! two (`consistency`).
//!
//! Proof sketch: relocations by which all robots that move stay together suffice, unless wrong alignments close cycles
//! among themselves by chance. Let another solution split a set in which no robot depends on one edge alone into k + 1
//! pieces that move apart. It gives up at least k + 1 edges, and k edges suffice to connect the pieces in another way.
//! What it gains beyond these k agrees with them, as two edges between the same pieces do, and one relocation gains
//! both.

use super::cut::{CutGraph, LeastCut};
use super::graph::{Cycle, Edge, Forest, Neighbours};
use super::uncertain::UncertainPose;
use crate::shared::geometry::wrap_angle;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Number of the triangles of an edge that are tested to find the edges that agree most.
const WITNESSES: usize = 8;

/// A set of edges that agree with each other.
pub(super) struct EdgeConsensus<'a> {
    robots: usize,
    edges: &'a [Edge],
    neighbours: &'a Neighbours,
    gate: f64,
    /// For every edge whether it is in the set.
    agrees: Vec<bool>,
}

/// A relocation of robots by which an edge outside of the set agrees.
struct Relocation {
    /// Number of edges outside that agree then, including the one that implies it.
    gain: usize,
    /// The robots that move, and the edges of the set that it costs. `None` if these are more than the gain.
    cut: Option<LeastCut>,
}

impl<'a> EdgeConsensus<'a> {
    /// Finds a set that no relocation enlarges, from edges that are known to agree. A cycle is closed if its Mahalanobis
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
        while consensus.relocate(&order) {}
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
    /// An edge outside of the set is disputed if its relocation costs no more than it gains, and so are the edges that
    /// it may cost. Disputed edges are no evidence for others, so the rest is checked again without them.
    pub(super) fn disputed(&self) -> BTreeMap<usize, Cycle> {
        let outside = self.outside();
        let mut disputed: BTreeMap<usize, Cycle> = BTreeMap::new();
        loop {
            let before = disputed.len();
            let mut relocations = Relocations::new(self, |index| self.agrees[index] && !disputed.contains_key(&index));
            for &index in &outside {
                if disputed.contains_key(&index) {
                    continue;
                }
                let Some(cut) = relocations.implied_by(index, &outside).cut else { continue };
                let Some(cycle) = self.neighbours.cycle(self.edges, index, |index| self.agrees[index]) else {
                    continue;
                };
                for edge in std::iter::once(index).chain(cut.edges_in_some_minimum_cut) {
                    disputed.entry(edge).or_insert_with(|| cycle.clone());
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

    /// Makes the first relocation that gains more than it costs. Returns whether there was one.
    fn relocate(&mut self, order: &[usize]) -> bool {
        let outside = self.outside();
        let mut relocations = Relocations::new(self, |index| self.agrees[index]);
        for &index in &outside {
            let Relocation { gain, cut } = relocations.implied_by(index, &outside);
            let Some(cut) = cut.filter(|cut| cut.cost < gain) else { continue };
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

/// Relocations of robots over a part of a set of edges that agree.
struct Relocations<'a> {
    edges: &'a [Edge],
    gate: f64,
    forest: Forest,
    /// `T_root_robot` and the root, for every robot.
    placed: Vec<UncertainPose>,
    graph: CutGraph,
}

impl<'a> Relocations<'a> {
    /// Relocations over those edges of the set for which `used` holds. The poses are those of the whole set.
    fn new(consensus: &EdgeConsensus<'a>, used: impl Fn(usize) -> bool) -> Self {
        let EdgeConsensus { robots, edges, gate, .. } = *consensus;
        let forest = Forest::grow(robots, edges, 0, |index| consensus.agrees[index]);
        let placed = forest.poses_by_tree(edges);
        let in_use = edges.iter().enumerate().filter(|(index, _)| used(*index));
        let graph = CutGraph::new(robots, in_use.map(|(index, edge)| (index, edge.a, edge.b)));
        Self { edges, gate, forest, placed, graph }
    }

    /// The relocation by which an edge outside of the set agrees: its robot b moves, and robot a stays.
    fn implied_by(&mut self, index: usize, outside: &[usize]) -> Relocation {
        let Edge { a: stays, b: moved, transform_a_b: transform_stays_moved } = self.edges[index];
        let mut supporting_edges = Vec::new();
        for &other in outside.iter().filter(|&&other| other != index) {
            let Edge { a, b, .. } = self.edges[other];
            for (other_moved, other_stays) in [(b, a), (a, b)] {
                if self.agree(&transform_stays_moved, [moved, stays], other, [other_moved, other_stays]) {
                    supporting_edges.push((other_moved, other_stays));
                }
            }
        }
        let gain = supporting_edges.len() + 1;
        Relocation { gain, cut: self.graph.part(moved, stays, supporting_edges.into_iter(), gain) }
    }

    /// Whether two edges outside imply the same relocation of the robots at one end relative to those at the other.
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

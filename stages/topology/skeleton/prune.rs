//! Removes spurs from a skeleton.

use super::{NodeKind, SkeletonGraph, SkeletonPath};
use std::f64::consts::SQRT_2;

impl SkeletonGraph {
    /// Removes spurs: dead ends from corners and rough walls.
    ///
    /// A path of length `l` from a junction with clearance `r` to an end with clearance `e` shows free space up to `l +
    /// e` from the junction. A square corner extends to `sqrt(2) * r`, whatever the size of the room. The path is a
    /// spur if it extends less than `min_spur` metres beyond that. All spurs are removed at once, so that a corridor
    /// that ends between two corners ends in the middle. A junction that is left with two paths becomes a part of one,
    /// with one path an end, and with none an isolated node; then spurs are sought again, until there are none. At last
    /// a path between two ends that meets no other is one node if it is shorter than the clearance there: a room.
    pub fn prune(&mut self, min_spur: f64) {
        while self.take_out_spurs(min_spur) {
            self.join_ways();
        }
        self.join_ends();
    }

    /// Number of paths at each node; one that returns to it counts twice.
    pub fn degrees(&self) -> Vec<usize> {
        let mut degrees = vec![0; self.nodes.len()];
        self.paths.iter().flat_map(|path| path.nodes).for_each(|node| degrees[node] += 1);
        degrees
    }

    /// Removes all spurs. Returns whether there were any.
    fn take_out_spurs(&mut self, min_spur: f64) -> bool {
        let degrees = self.degrees();
        let mut is_gone = vec![false; self.nodes.len()];
        let nodes = &self.nodes;
        self.paths.retain(|path| {
            let [start, end] = path.nodes;
            let (tip, foot) = if degrees[start] == 1 { (start, end) } else { (end, start) };
            let reach = path.length + nodes[tip].clearance - SQRT_2 * nodes[foot].clearance;
            let is_spur = degrees[tip] == 1 && degrees[foot] > 2 && reach < min_spur;
            is_gone[tip] |= is_spur;
            !is_spur
        });
        self.drop_nodes(&is_gone);
        is_gone.contains(&true)
    }

    /// Joins two paths at a junction without others.
    fn join_ways(&mut self) {
        let mut ways: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for (number, path) in self.paths.iter().enumerate() {
            path.nodes.iter().for_each(|node| ways[*node].push(number));
        }
        let mut is_gone = vec![false; self.nodes.len()];
        for node in 0..self.nodes.len() {
            let kind = &mut self.nodes[node].kind;
            match *ways[node] {
                [] | [_] => *kind = NodeKind::End,
                [one, other] if one == other => *kind = NodeKind::Loop,
                [one, other] => {
                    let follows = std::mem::take(&mut self.paths[other].cells);
                    let follows = SkeletonPath { cells: follows, ..self.paths[other] };
                    let far = follows.far_node(node);
                    self.paths[one].go_on(node, follows);
                    ways[far].iter_mut().filter(|way| **way == other).for_each(|way| *way = one);
                    is_gone[node] = true;
                }
                _ => {}
            }
        }
        self.paths.retain(|path| !path.cells.is_empty());
        self.drop_nodes(&is_gone);
    }

    /// Joins two ends to one node, if they are connected by nothing but a path that is shorter than the clearance.
    fn join_ends(&mut self) {
        let degrees = self.degrees();
        let mut is_gone = vec![false; self.nodes.len()];
        let nodes = &self.nodes;
        self.paths.retain(|path| {
            let [start, end] = path.nodes;
            let is_room = degrees[start] == 1
                && degrees[end] == 1
                && path.length < nodes[start].clearance.max(nodes[end].clearance);
            let narrower = if nodes[end].clearance > nodes[start].clearance { start } else { end };
            is_gone[narrower] |= is_room;
            !is_room
        });
        self.drop_nodes(&is_gone);
    }

    /// Removes nodes without paths.
    fn drop_nodes(&mut self, is_gone: &[bool]) {
        let mut left = 0;
        let mut numbers = Vec::with_capacity(is_gone.len());
        for is_gone in is_gone {
            numbers.push(left);
            left += usize::from(!is_gone);
        }
        let mut gone = is_gone.iter();
        self.nodes.retain(|_| gone.next() == Some(&false));
        self.paths.iter_mut().flat_map(|path| &mut path.nodes).for_each(|node| *node = numbers[*node]);
    }
}

impl SkeletonPath {
    /// The node at the other end.
    pub fn far_node(&self, node: usize) -> usize {
        if self.nodes[0] == node { self.nodes[1] } else { self.nodes[0] }
    }

    fn turn_round(&mut self) {
        self.nodes.reverse();
        self.cells.reverse();
    }

    /// Appends a path that begins or ends at `node`.
    fn go_on(&mut self, node: usize, mut by: Self) {
        if self.nodes[1] != node {
            self.turn_round();
        }
        if by.nodes[0] != node {
            by.turn_round();
        }
        self.nodes[1] = by.nodes[1];
        self.length += by.length;
        self.cells.extend(by.cells.into_iter().skip(1));
    }
}

//! Alignments that many triangles show to be wrong.

use super::UncertainPose;
use super::graph::Edge;
use std::collections::{BTreeMap, BTreeSet};

/// The edges of `group` that are outvoted by the triangles they are in, for graphs with so many wrong edges that
/// trying all sets of them would take too long.
///
/// A triangle that does not close speaks against an edge if each of its other two edges lies in more triangles that
/// close than in triangles that do not. An edge is outvoted when at least three more triangles speak against it than
/// twice those that close with it. Outvoted edges are taken away and the rest is counted again, until none is left.
pub(super) fn outvoted(edges: &[Edge], group: &[usize], gate: f64) -> BTreeSet<usize> {
    let mut triangles = triangles(edges, group, gate);
    let mut outvoted = BTreeSet::new();
    loop {
        let mut closing = vec![0usize; edges.len()];
        let mut open = vec![0usize; edges.len()];
        for triangle in &triangles {
            let count = if triangle.closes { &mut closing } else { &mut open };
            triangle.edges.iter().for_each(|&index| count[index] += 1);
        }
        let mut against = vec![0usize; edges.len()];
        for Triangle { edges: [i, j, k], .. } in triangles.iter().filter(|triangle| !triangle.closes) {
            let is_credible = |index: &usize| closing[*index] > open[*index];
            for (accused, one, other) in [(i, j, k), (j, i, k), (k, i, j)] {
                against[*accused] += usize::from(is_credible(one) && is_credible(other));
            }
        }
        let before = outvoted.len();
        outvoted.extend(group.iter().copied().filter(|&index| against[index] >= 2 * closing[index] + 3));
        if outvoted.len() == before {
            return outvoted;
        }
        triangles.retain(|triangle| triangle.edges.iter().all(|index| !outvoted.contains(index)));
    }
}

struct Triangle {
    edges: [usize; 3],
    closes: bool,
}

fn triangles(edges: &[Edge], group: &[usize], gate: f64) -> Vec<Triangle> {
    let mut neighbours: BTreeMap<usize, BTreeMap<usize, usize>> = BTreeMap::new();
    for &index in group {
        let (low, high) = (edges[index].a.min(edges[index].b), edges[index].a.max(edges[index].b));
        neighbours.entry(low).or_default().insert(high, index);
    }
    let mut triangles = Vec::new();
    for (&a, above_a) in &neighbours {
        for (&b, &a_b) in above_a {
            let Some(above_b) = neighbours.get(&b) else { continue };
            for (c, &b_c) in above_b {
                let Some(&a_c) = above_a.get(c) else { continue };
                let round: UncertainPose = edges[a_b]
                    .transform_from(a)
                    .then(&edges[b_c].transform_from(b))
                    .then(&edges[a_c].transform_from(*c));
                let closes = round.distance_from_identity() <= gate;
                triangles.push(Triangle { edges: [a_b, b_c, a_c], closes });
            }
        }
    }
    triangles
}

//! Similarity of two topological maps at a relative pose.

use super::Topology;
use crate::shared::geometry::{Point2, Pose2};

/// A path of map a and a path of map b that coincide, each by the indices of its nodes: their first ends coincide,
/// and their second ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathPair {
    /// The nodes of the path in map a.
    pub a: [usize; 2],
    /// The nodes of the path in map b.
    pub b: [usize; 2],
}

/// The pairs of paths that coincide when map b is placed on map a: their number is the similarity of equation 2, each
/// pair counting as in equation 3, where ends are equal that lie within `tolerance` metres. A path may be read from
/// either end.
pub fn coinciding(a: &Topology, b: &Topology, transform_a_b: &Pose2, tolerance: f64) -> Vec<PathPair> {
    let placed: Vec<Point2> = b.nodes.iter().map(|node| transform_a_b * node).collect();
    let paths_a: Vec<[usize; 2]> = a.long_paths(tolerance).collect();
    let mut pairs = Vec::new();
    for ends_b in b.long_paths(tolerance) {
        for &ends_a in &paths_a {
            let lies = |a_end: usize, b_end: usize| (a.nodes[a_end] - placed[b_end]).norm() <= tolerance;
            for ends_b in [ends_b, [ends_b[1], ends_b[0]]] {
                if lies(ends_a[0], ends_b[0]) && lies(ends_a[1], ends_b[1]) {
                    pairs.push(PathPair { a: ends_a, b: ends_b });
                }
            }
        }
    }
    pairs
}

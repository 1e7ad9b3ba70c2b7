//! An edge of a topological map, for the comparison with others.

use gridweave_runtime::ros::{TopologicalMap, TopologicalPath};
use gridweave_stages::shared::geometry::Point2;
use nalgebra::Vector2;

/// Number of points of the shape of an edge.
pub(super) const SHAPE_POINTS: usize = 17;

/// An edge with the features by which it is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Length, metres.
    pub length: f64,
    /// Probability that it exists, 0 to 1.
    pub probability: f64,
    /// Whether each of its two ends is a dead end, without another edge.
    pub is_dead_end: [bool; 2],
    /// The mean of its points, metres, map frame.
    pub middle: Point2,
    /// Points at even distances along it from its first end to its last, relative to the mean.
    pub shape: [Vector2<f64>; SHAPE_POINTS],
}

/// The edges of a topological map that are at least `min_length` metres long. Paths with an invalid node or values
/// that are not finite are left out.
pub fn edges(map: &TopologicalMap, min_length: f64) -> Vec<Edge> {
    let mut degrees = vec![0usize; map.nodes.len()];
    for node in map.paths.iter().flat_map(|path| [path.start, path.end]) {
        if let Some(degree) = degrees.get_mut(node as usize) {
            *degree += 1;
        }
    }
    let edge = |path: &TopologicalPath| {
        let is_dead_end = [path.start, path.end].map(|node| degrees.get(node as usize).map(|degree| *degree < 2));
        let [Some(first), Some(last)] = is_dead_end else { return None };
        let points: Vec<Point2> = path.points.iter().map(|point| Point2::new(point.x, point.y)).collect();
        let is_usable = points.iter().all(|point| point.iter().all(|value| value.is_finite()))
            && path.length.is_finite()
            && path.length >= min_length
            && (0.0..=1.0).contains(&path.probability);
        let sampled = sampled(&points).filter(|_| is_usable)?;
        let middle = sampled.iter().fold(Vector2::zeros(), |sum, point| sum + point.coords) / SHAPE_POINTS as f64;
        Some(Edge {
            length: path.length,
            probability: path.probability,
            is_dead_end: [first, last],
            middle: Point2::from(middle),
            shape: sampled.map(|point| point.coords - middle),
        })
    };
    map.paths.iter().filter_map(edge).collect()
}

/// Points at even distances along a line from its first point to its last. `None` for a line without length.
fn sampled(points: &[Point2]) -> Option<[Point2; SHAPE_POINTS]> {
    let total: f64 = points.windows(2).map(|two| (two[1] - two[0]).norm()).sum();
    let first = points.first().filter(|_| total > 0.0 && total.is_finite())?;
    let mut sampled = [*first; SHAPE_POINTS];
    let (mut behind, mut segment) = (0.0, 0);
    for (number, place) in sampled.iter_mut().enumerate() {
        let wanted = total * number as f64 / (SHAPE_POINTS - 1) as f64;
        loop {
            let (start, end) = (points[segment], points[segment + 1]);
            let length = (end - start).norm();
            let is_last = segment + 2 == points.len();
            if behind + length >= wanted || is_last {
                let share = if length > 0.0 { ((wanted - behind) / length).clamp(0.0, 1.0) } else { 0.0 };
                *place = start + (end - start) * share;
                break;
            }
            behind += length;
            segment += 1;
        }
    }
    Some(sampled)
}

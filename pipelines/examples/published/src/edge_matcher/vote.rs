//! Pairs of similar edges, and the translations that they vote for.

use super::EdgeMatcherParameters;
use super::edge::{Edge, SHAPE_POINTS};
use nalgebra::{UnitComplex, Vector2};

/// The vote of two similar edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vote {
    /// Indices of the edges of map a and of map b.
    pub edges: [usize; 2],
    /// The translation that aligns the centroid of the edge of b, turned, with that of a, metres.
    pub translation: Vector2<f64>,
    /// The length of the shorter edge times both probabilities, metres.
    pub weight: f64,
    /// Root mean square distance of the points of both edges then, metres.
    pub residual: f64,
}

/// Votes of all pairs of edges that are similar once map b is turned, by the edges of a and then of b.
pub fn votes(a: &[Edge], b: &[Edge], rotation: &UnitComplex<f64>, parameters: &EdgeMatcherParameters) -> Vec<Vote> {
    let turned: Vec<[Vector2<f64>; SHAPE_POINTS]> =
        b.iter().map(|edge| edge.shape.map(|point| rotation * point)).collect();
    let mut votes = Vec::new();
    for (number_a, edge_a) in a.iter().enumerate() {
        for (number_b, (edge_b, shape_b)) in b.iter().zip(&turned).enumerate() {
            let longer = edge_a.length.max(edge_b.length);
            if (edge_a.length - edge_b.length).abs() > parameters.length_tolerance * longer {
                continue;
            }
            let residual = residual(edge_a, edge_b, shape_b);
            if residual <= parameters.shape_tolerance {
                votes.push(Vote {
                    edges: [number_a, number_b],
                    translation: edge_a.middle.coords - rotation * edge_b.middle.coords,
                    weight: edge_a.length.min(edge_b.length) * edge_a.probability * edge_b.probability,
                    residual,
                });
            }
        }
    }
    votes
}

/// Root mean square distance of the points of two edges, in the better of both directions in which the ends are of
/// the same degrees, metres; infinite if there is none.
fn residual(a: &Edge, b: &Edge, turned_b: &[Vector2<f64>; SHAPE_POINTS]) -> f64 {
    let root = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let squares: f64 = a.shape.iter().zip(points).map(|(a, b)| (a - b).norm_squared()).sum();
        (squares / SHAPE_POINTS as f64).sqrt()
    };
    let [first, last] = b.is_dead_end;
    let forth = if a.is_dead_end == [first, last] { root(&mut turned_b.iter()) } else { f64::INFINITY };
    let back = if a.is_dead_end == [last, first] { root(&mut turned_b.iter().rev()) } else { f64::INFINITY };
    forth.min(back)
}

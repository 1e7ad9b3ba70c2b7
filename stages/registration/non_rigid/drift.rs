//! Estimates the drift of a map, which the parameters `bend` and `turn` assume.

use super::DeformationParameters;
use super::equations::{Covariances, Edge};
use crate::shared::deformation::Deformation;
use nalgebra::Matrix3;

/// Least number of edges between nodes that walls constrain, for an estimate.
const LEAST_KNOWN: f64 = 6.0;

/// Drift of a map, estimated from its walls: standard deviations per square root of a metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Of the displacement of two points against each other, metres.
    pub displacement: f64,
    /// Of the turn of two points against each other, radians.
    pub turn: f64,
}

/// Estimates the drift with the maximum likelihood: the squared deformations by the number of those that walls
/// constrain, not the prior (one step of MacKay 1992, "Bayesian interpolation"). `first` is the index of the map's
/// first node among those of all maps. `None` if walls constrain too little.
pub(super) fn drift(
    deformation: &Deformation,
    first: usize,
    covariances: &Covariances<'_>,
    parameters: &DeformationParameters,
) -> Option<Drift> {
    let (mut squares, mut known) = ([0.0; 2], [0.0; 2]);
    for (i, j) in deformation.lattice.edges() {
        let arm = deformation.lattice.position(j) - deformation.lattice.position(i);
        let edge = Edge::new(&arm, parameters);
        let found = edge.by_i * deformation.moves[i] + edge.by_j * deformation.moves[j];
        let (i, j) = (first + i, first + j);
        let mixed = edge.by_i * covariances.of(i, j) * edge.by_j.transpose();
        let left: Matrix3<f64> = edge.by_i * covariances.of(i, i) * edge.by_i.transpose()
            + edge.by_j * covariances.of(j, j) * edge.by_j.transpose()
            + mixed
            + mixed.transpose();
        // Share of each component that walls constrain.
        let from_walls = |part: usize| (1.0 - left[(part, part)] * edge.information[(part, part)]).clamp(0.0, 1.0);
        squares[0] += (found.x.powi(2) + found.y.powi(2)) / arm.norm();
        squares[1] += found.z.powi(2) / arm.norm();
        known[0] += from_walls(0) + from_walls(1);
        known[1] += from_walls(2);
    }
    let is_known = known.iter().all(|known| *known >= LEAST_KNOWN);
    is_known.then(|| Drift { displacement: (squares[0] / known[0]).sqrt(), turn: (squares[1] / known[1]).sqrt() })
}

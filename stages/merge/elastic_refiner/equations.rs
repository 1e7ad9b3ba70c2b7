//! Normal equations of all nodes of all maps, and their solution.

use super::ElasticRefinerParameters;
use super::body::Body;
use crate::shared::deformation::Deformation;
use crate::shared::geometry::Point2;
use crate::shared::sparse::{BlockCholesky, Columns, Dissection, SelectedInverse, factor};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::sync::Arc;

/// Prior of the nodes about the rigid frames: standard deviations, metres and radians. They are far larger than the
/// error of frames, so the prior only fixes what nothing else does, such as the pose of all maps together.
const FRAME_DEVIATION: (f64, f64) = (0.5, 0.1);
/// The same for a map that is not to be deformed: nearly zero.
const KEPT_DEVIATION: (f64, f64) = (1e-5, 1e-6);

/// Normal equations by node. The nodes of all bodies are numbered consecutively.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    /// Elimination order of the nodes.
    pub(super) order: Arc<Dissection>,
    columns: Columns,
    vector: Vec<Vector3<f64>>,
}

impl Equations {
    /// Prior on the deformations of the bodies, without walls.
    pub(super) fn of_deformations(
        bodies: &[Body<'_>],
        order: &Arc<Dissection>,
        parameters: &ElasticRefinerParameters,
    ) -> Self {
        let count = order.places.len();
        let mut equations =
            Self { order: Arc::clone(order), columns: vec![Vec::new(); count], vector: vec![Vector3::zeros(); count] };
        let mut first = 0;
        for body in bodies {
            let (shift, turn) = if body.is_kept { KEPT_DEVIATION } else { FRAME_DEVIATION };
            let of_frame = Vector3::new(shift, shift, turn).map(|deviation| deviation.powi(-2));
            for node in first..first + body.shape.lattice.len() {
                equations.add(node, node, || Matrix3::from_diagonal(&of_frame));
            }
            for (i, j) in body.shape.lattice.edges() {
                let (at_i, at_j) = (body.shape.lattice.position(i), body.shape.lattice.position(j));
                equations.add_edge((first + i, at_i), (first + j, at_j), parameters);
            }
            first += body.shape.lattice.len();
        }
        equations
    }

    /// Adds the prior on two neighbouring nodes: the displacement between them is that of a rigid piece that is
    /// turned by the mean of both, and both are turned alike.
    fn add_edge(
        &mut self,
        (i, at_i): (usize, Point2),
        (j, at_j): (usize, Point2),
        parameters: &ElasticRefinerParameters,
    ) {
        let edge = Edge::new(&(at_j - at_i), parameters);
        for (row, by_row) in [(i, edge.by_i), (j, edge.by_j)] {
            for (column, by_column) in [(i, edge.by_i), (j, edge.by_j)] {
                self.add(row, column, || by_row.transpose() * edge.information * by_column);
            }
        }
    }

    /// Adds a block for two nodes. The matrix is symmetric, so blocks of two nodes are to be added in both orders.
    pub(super) fn add(&mut self, row: usize, column: usize, block: impl FnOnce() -> Matrix3<f64>) {
        let (row, column) = (self.order.places[row], self.order.places[column]);
        if row >= column {
            self.columns[column].push((row, block()));
        }
    }

    pub(super) fn add_vector(&mut self, node: usize, part: &Vector3<f64>) {
        self.vector[self.order.places[node]] += part;
    }

    /// Solves the equations. `None` if they have no solution.
    pub(super) fn solve(&self) -> Option<Solution> {
        let factor = factor(&self.columns, &self.order.whole)?;
        let solved = factor.solve(&self.vector);
        let moves = self.order.places.iter().map(|&place| solved[place]).collect();
        let explained = self.vector.iter().zip(&solved).map(|(part, by)| part.dot(by)).sum();
        Some(Solution { moves, explained, order: Arc::clone(&self.order), factor })
    }

    /// Logarithm of the determinant of the matrix. `None` if the equations have no solution.
    pub(super) fn log_determinant(&self) -> Option<f64> {
        Some(factor(&self.columns, &self.order.whole)?.log_determinant())
    }
}

/// Drift between two neighbouring nodes i and j.
pub(super) struct Edge {
    /// Derivative of (t_j - t_i - (turn_i + turn_j) / 2 * quarter turn of the arm, turn_j - turn_i) with respect to
    /// the move of node i.
    pub(super) by_i: Matrix3<f64>,
    /// The same for node j.
    pub(super) by_j: Matrix3<f64>,
    /// Inverse of its covariance.
    pub(super) information: Matrix3<f64>,
}

impl Edge {
    /// Edge between two nodes with `arm` from i to j, metres.
    pub(super) fn new(arm: &Vector2<f64>, parameters: &ElasticRefinerParameters) -> Self {
        let deviation = Vector3::new(parameters.bend, parameters.bend, parameters.turn) * arm.norm().sqrt();
        let half = 0.5 * arm;
        Self {
            by_i: -Matrix3::new(1.0, 0.0, -half.y, 0.0, 1.0, half.x, 0.0, 0.0, 1.0),
            by_j: Matrix3::new(1.0, 0.0, half.y, 0.0, 1.0, -half.x, 0.0, 0.0, 1.0),
            information: Matrix3::from_diagonal(&deviation.map(|deviation| deviation.powi(-2))),
        }
    }
}

/// Half the squared deformations between neighbouring nodes, in standard deviations.
pub(super) fn deformation_cost(deformation: &Deformation, parameters: &ElasticRefinerParameters) -> f64 {
    let edges = deformation.lattice.edges().map(|(i, j)| {
        let edge = Edge::new(&(deformation.lattice.position(j) - deformation.lattice.position(i)), parameters);
        let residual = edge.by_i * deformation.moves[i] + edge.by_j * deformation.moves[j];
        0.5 * residual.dot(&(edge.information * residual))
    });
    edges.sum()
}

/// Solution of the normal equations.
pub(super) struct Solution {
    /// Displacement and turn of each node.
    pub(super) moves: Vec<Vector3<f64>>,
    /// Reduction of the sum of squares by the moves, in variances.
    pub(super) explained: f64,
    order: Arc<Dissection>,
    factor: BlockCholesky,
}

impl Solution {
    /// Logarithm of the determinant of the matrix of the equations.
    pub(super) fn log_determinant(&self) -> f64 {
        self.factor.log_determinant()
    }

    /// Covariances of the nodes.
    pub(super) fn covariances(&self) -> Covariances<'_> {
        Covariances { places: &self.order.places, inverse: self.factor.selected_inverse() }
    }
}

/// Covariances of nodes, and of neighbouring nodes with each other.
pub(super) struct Covariances<'a> {
    places: &'a [usize],
    inverse: SelectedInverse<'a>,
}

impl Covariances<'_> {
    /// Covariance of the moves of two nodes, equal or neighbouring.
    pub(super) fn of(&self, one: usize, other: usize) -> Matrix3<f64> {
        self.inverse.at(self.places[one], self.places[other])
    }
}

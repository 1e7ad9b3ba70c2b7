//! Normal equations of all nodes of all maps, and their solution.

use super::DeformationParameters;
use super::body::Body;
use crate::shared::deformation::Deformation;
use crate::shared::geometry::Point2;
use crate::shared::sparse::{BlockCholesky, Columns, SelectedInverse, factor};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::sync::Arc;

/// Prior of the nodes about the rigid frames: standard deviations, metres and radians. They are far larger than the
/// error of frames, so the prior only fixes what nothing else does, such as the pose of all maps together.
const FRAME_DEVIATION: (f64, f64) = (0.5, 0.1);

/// The nodes of all bodies, numbered consecutively, and which of them are estimated.
#[derive(Clone, Debug)]
pub(super) struct Unknowns {
    /// Place of each node in the elimination order. None for one whose move is given.
    places: Vec<Option<usize>>,
    /// Moves of the nodes that are given; of others any.
    given: Vec<Vector3<f64>>,
    /// Number of those that are estimated.
    count: usize,
}

impl Unknowns {
    /// Nodes with their places, and the moves of those without one.
    pub(super) fn new(places: Vec<Option<usize>>, given: Vec<Vector3<f64>>) -> Self {
        let count = places.iter().flatten().count();
        Self { places, given, count }
    }
}

/// Normal equations of the nodes that are estimated.
#[derive(Clone, Debug)]
pub(super) struct Equations {
    pub(super) unknowns: Arc<Unknowns>,
    columns: Columns,
    vector: Vec<Vector3<f64>>,
}

impl Equations {
    /// Prior on the deformations of the bodies, without walls.
    pub(super) fn of_deformations(
        bodies: &[Body<'_>],
        unknowns: &Arc<Unknowns>,
        parameters: &DeformationParameters,
    ) -> Self {
        let count = unknowns.count;
        let mut equations = Self {
            unknowns: Arc::clone(unknowns),
            columns: vec![Vec::new(); count],
            vector: vec![Vector3::zeros(); count],
        };
        let (shift, turn) = FRAME_DEVIATION;
        let of_frame = Matrix3::from_diagonal(&Vector3::new(shift, shift, turn).map(|deviation| deviation.powi(-2)));
        let mut first = 0;
        for body in bodies {
            for node in first..first + body.shape.lattice.len() {
                equations.add(node, node, &of_frame);
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
    fn add_edge(&mut self, (i, at_i): (usize, Point2), (j, at_j): (usize, Point2), parameters: &DeformationParameters) {
        let Edge { by_i, by_j, information } = Edge::new(&(at_j - at_i), parameters);
        self.add(i, i, &(by_i.transpose() * information * by_i));
        self.add(j, i, &(by_j.transpose() * information * by_i));
        self.add(j, j, &(by_j.transpose() * information * by_j));
    }

    /// Adds the block of a row and a column of two nodes, and its transpose for the column and the row. What it has
    /// with the move of a node that is given goes to the right-hand side.
    pub(super) fn add(&mut self, one: usize, other: usize, block: &Matrix3<f64>) {
        let unknowns = &*self.unknowns;
        match (unknowns.places[one], unknowns.places[other]) {
            (Some(row), Some(column)) if row >= column => add_entry(&mut self.columns[column], row, block),
            (Some(column), Some(row)) => add_entry(&mut self.columns[column], row, &block.transpose()),
            (Some(row), None) => self.vector[row] -= block * unknowns.given[other],
            (None, Some(row)) => self.vector[row] -= block.tr_mul(&unknowns.given[one]),
            (None, None) => {}
        }
    }

    pub(super) fn add_vector(&mut self, node: usize, part: &Vector3<f64>) {
        if let Some(place) = self.unknowns.places[node] {
            self.vector[place] += part;
        }
    }

    /// Solves the equations. `None` if they have no solution.
    pub(super) fn solve(&self) -> Option<Solution> {
        let factor = factor(&self.columns)?;
        let solved = factor.solve(&self.vector);
        let nodes = self.unknowns.places.iter().zip(&self.unknowns.given);
        let moves = nodes.map(|(place, given)| place.map_or(*given, |place| solved[place])).collect();
        let explained = self.vector.iter().zip(&solved).map(|(part, by)| part.dot(by)).sum();
        Some(Solution { moves, explained, unknowns: Arc::clone(&self.unknowns), factor })
    }

    /// Logarithm of the determinant of the matrix. `None` if the equations have no solution.
    pub(super) fn log_determinant(&self) -> Option<f64> {
        Some(factor(&self.columns)?.log_determinant())
    }
}

/// Adds a block to that in a row of a column, whose entries are in the order of rows.
fn add_entry(entries: &mut Vec<(usize, Matrix3<f64>)>, row: usize, block: &Matrix3<f64>) {
    match entries.binary_search_by_key(&row, |(row, _)| *row) {
        Ok(place) => entries[place].1 += block,
        Err(place) => entries.insert(place, (row, *block)),
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
    pub(super) fn new(arm: &Vector2<f64>, parameters: &DeformationParameters) -> Self {
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
pub(super) fn deformation_cost(deformation: &Deformation, parameters: &DeformationParameters) -> f64 {
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
    unknowns: Arc<Unknowns>,
    factor: BlockCholesky,
}

impl Solution {
    /// Logarithm of the determinant of the matrix of the equations.
    pub(super) fn log_determinant(&self) -> f64 {
        self.factor.log_determinant()
    }

    /// Covariances of the nodes.
    pub(super) fn covariances(&self) -> Covariances<'_> {
        Covariances { places: &self.unknowns.places, inverse: self.factor.selected_inverse() }
    }
}

/// Covariances of nodes, and of neighbouring nodes with each other.
pub(super) struct Covariances<'a> {
    places: &'a [Option<usize>],
    inverse: SelectedInverse<'a>,
}

impl Covariances<'_> {
    /// Covariance of the moves of two nodes, equal or neighbouring. Zeros where one of them is given.
    pub(super) fn of(&self, one: usize, other: usize) -> Matrix3<f64> {
        let places = self.places[one].zip(self.places[other]);
        places.map_or_else(Matrix3::zeros, |(one, other)| self.inverse.at(one, other))
    }
}

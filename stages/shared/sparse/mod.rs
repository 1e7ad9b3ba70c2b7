//! Direct solution of sparse symmetric systems of blocks of 3 x 3: those of poses and of nodes of a deformation.
//!
//! [`minimum_degree`] orders the unknowns, [`factor`] computes the Cholesky factor in that order, and
//! [`BlockCholesky`] solves with it and computes the parts of the inverse that are needed. [`SimilarSystems`] solves further
//! systems with the factor of one. Arithmetic is done on dense parts, the fronts of an assembly tree.

mod assembly_tree;
mod block_cholesky;
mod block_column;
mod factoring;
mod minimum_degree;
mod selected_inverse;
mod similar_systems;
#[cfg(test)]
mod tests;

pub(crate) use block_cholesky::BlockCholesky;
pub(crate) use factoring::factor;
pub(crate) use minimum_degree::minimum_degree;
pub(crate) use selected_inverse::SelectedInverse;
pub(crate) use similar_systems::SimilarSystems;

use nalgebra::Matrix3;

/// Lower triangle of a symmetric matrix by columns: the entries of each in any order, and several for one position,
/// which are summed.
pub(crate) type Columns = Vec<Vec<(usize, Matrix3<f64>)>>;

//! Direct solution of sparse symmetric systems of blocks of 3 x 3: those of poses and of nodes of a deformation.
//!
//! [`Dissection`] orders the unknowns, [`factor`] computes the Cholesky factor in that order, and [`BlockCholesky`]
//! solves with it and computes the parts of the inverse that are needed.

mod block_cholesky;
mod dissection;
mod factoring;

pub(crate) use block_cholesky::{BlockCholesky, SelectedInverse};
pub(crate) use dissection::{Dissection, Part};
pub(crate) use factoring::{Columns, factor};

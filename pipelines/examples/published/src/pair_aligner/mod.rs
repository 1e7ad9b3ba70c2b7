//! Common parts of the published aligners that use the maps of two robots only, and verify their results by the
//! acceptance index.
//!
//! They search, rank their hypotheses by omega (see [`AcceptanceIndex`](crate::acceptance_index::AcceptanceIndex)), and
//! accept the best if its omega is high enough. There is no other check against a wrong merge: maps of different
//! buildings, and self-similar buildings, may have a high omega at a wrong pose. `merge_verifier` uses more evidence.
//!
//! - [`RatedPose`]: a relative pose with its index.
//! - [`Criterion`]: ranks hypotheses, and decides whether the best is accepted.
//! - [`PairAligner`]: the stage of a [`Method`].

mod criterion;
mod rated_pose;
mod stage;
#[cfg(test)]
pub(crate) mod test_maps;

pub use criterion::{Criterion, Judgement};
pub use rated_pose::{RatedPose, known_area};
pub use stage::{Method, PairAligner};

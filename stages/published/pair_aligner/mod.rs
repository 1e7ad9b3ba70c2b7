//! What the published aligners share that lay the maps of two robots on each other by the maps alone and believe what they
//! find by the acceptance index.
//!
//! They search, rank what they have found by omega (see [`AcceptanceIndex`](crate::published::acceptance_index::AcceptanceIndex)), and
//! accept the best if its omega is high enough. Nothing else stands between them and a wrong merge: maps of different
//! buildings, and buildings that look alike at several places, may have a high omega at a wrong place. `merge_verifier` looks
//! at what omega does not.
//!
//! - [`Hypothesis`]: a place that was found, and its index.
//! - [`Criterion`]: ranks hypotheses, and says whether the best is accepted and why.
//! - [`PairAligner`]: the stage round a [`Method`].

mod criterion;
mod hypothesis;
mod stage;

pub use criterion::{Criterion, Judgement};
pub use hypothesis::{Hypothesis, known_area};
pub use stage::{Method, PairAligner};

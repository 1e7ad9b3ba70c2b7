//! Judges all hypotheses for a pair of maps against each other, and gives each a probability.
//!
//! The log-odds of a hypothesis is a sum of [`Term`]s: peak significance of the search, common area, walls that agree
//! and walls that contradict, details, and things on open floor; and a prior from tags and from initial poses. The
//! probability of each is `exp(s_i) / (1 + sum of exp(s_j))` over all hypotheses, where the 1 is for none of them (a
//! conditional logit; McFadden 1974). So a hypothesis that fits nearly as well takes probability away, wherever it
//! comes from: another peak of the search, other tags, or a self-similar part of the building ([`SelfSimilarity`]).
//!
//! The weights are fitted by `experiments fit-judgement`, which writes [`weights`], to pairs of published maps,
//! recorded and simulated ones, cross-validated by building.

mod candidate;
mod comparisons;
mod competition;
mod decision;
mod judge;
mod parameters;
mod priors;
mod refusal;
mod self_similarity;
mod terms;
pub mod weights;

#[cfg(test)]
mod tests;

pub use candidate::Candidate;
pub use comparisons::Comparisons;
pub use competition::posterior;
pub use decision::Decision;
pub use judge::{UserKnowledge, candidates, judge, judge_again};
pub use parameters::JudgementParameters;
pub use refusal::{Listed, Refusal};
pub use self_similarity::{Alias, SelfSimilarity};
pub use terms::{COUNT, Term, Terms};

//! Judges all hypotheses for a pair of maps against each other: one sum for each, and one probability for each over all.
//!
//! The log-odds of a hypothesis is a sum of [`Term`]s: how far it stands out in the search, how much the maps share there, how many
//! walls agree that need not, what contradicts, and how much map b must be deformed; and what tags or the user know before the maps
//! are compared. The probability of each is `exp(s_i) / (1 + sum of exp(s_j))` over all hypotheses, where the 1 stands for none of them
//! (a conditional logit; McFadden 1974). So a hypothesis that fits nearly as well takes probability away, wherever it comes from:
//! another peak of the search, tags that say otherwise, or a part of the building that looks alike ([`SelfSimilarity`]).
//!
//! The weights are fitted by `experiments fit-judgement`, which writes [`weights`], to pairs of published maps, recorded and simulated
//! ones, cross-validated by place.

mod candidate;
mod judge;
mod parameters;
mod priors;
mod refusal;
mod self_similarity;
mod terms;
mod verdict;
pub mod weights;

#[cfg(test)]
mod tests;

pub use candidate::Candidate;
pub use judge::{UserKnowledge, candidates, judge, posterior};
pub use parameters::JudgementParameters;
pub use refusal::{Listed, Refusal};
pub use self_similarity::{Alias, SelfSimilarity};
pub use terms::{COUNT, Term, Terms};
pub use verdict::Verdict;

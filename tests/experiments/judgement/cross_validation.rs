//! What becomes of each pair by weights that its place took no part in.

use super::examples::Example;
use super::fit::Weights;
use crate::map_pairs::truth::Closeness;
use anyhow::Result;
use gridweave_stages::registration::judgement::posterior;
use std::collections::BTreeSet;

/// What becomes of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged {
    /// The probability of the best place, its likeliest alias taken into account.
    pub(super) probability: f64,
    /// How near it is to the truth.
    pub(super) closeness: Closeness,
}

impl Judged {
    /// Judges a pair.
    pub(super) fn new(example: &Example, weights: &Weights) -> Self {
        let places = &example.places;
        let log_odds: Vec<f64> = places.iter().map(|place| weights.places.of(&place.terms)).collect();
        let best = (0..places.len()).max_by(|one, other| log_odds[*one].total_cmp(&log_odds[*other]));
        let Some(best) = best else { return Self { probability: 0.0, closeness: Closeness::Wrong } };
        let of_aliases = example.aliases.iter().map(|(terms, _)| weights.aliases.of(terms));
        let alias = of_aliases.fold(f64::NEG_INFINITY, f64::max).exp();
        // What ICP has refused is not merged, whatever its probability.
        let probability = if places[best].is_refused { 0.0 } else { 1.0 / (1.0 / posterior(&log_odds)[best] + alias) };
        Self { probability, closeness: places[best].closeness }
    }
}

/// Judges each pair by the weights that are fitted to the places of the other parts.
pub(super) fn judge(examples: &[Example], folds: usize) -> Result<Vec<Judged>> {
    let places: BTreeSet<&str> = examples.iter().map(|example| example.place.as_str()).collect();
    let places: Vec<&str> = places.into_iter().collect();
    // Dealt in turn, in the order of their names.
    let fold_of = |example: &Example| places.binary_search(&example.place.as_str()).unwrap_or_default() % folds.max(2);
    let mut judged = vec![Judged { probability: 0.0, closeness: Closeness::Wrong }; examples.len()];
    for fold in 0..folds.max(2) {
        let others: Vec<&Example> = examples.iter().filter(|example| fold_of(example) != fold).collect();
        let weights = Weights::fit(&others)?;
        for (example, judged) in examples.iter().zip(&mut judged).filter(|(example, _)| fold_of(example) == fold) {
            *judged = Judged::new(example, &weights);
        }
    }
    Ok(judged)
}

//! The conditional logit (McFadden 1974) that the weights come from.

use super::examples::Example;
use crate::map_pairs::truth::Closeness;
use anyhow::{Result, bail};
use gridweave_stages::registration::judgement::{COUNT, Term, posterior};
use nalgebra::{DMatrix, DVector};

/// The precision of the prior of a weight, in units of the spread of its term: so small that it only holds weights that
/// the data leave open.
const REGULARISATION: f64 = 1.0;
/// Simulated pairs that belong together weigh half as much in all as recorded ones: they only stand for what is not
/// recorded.
const SIMULATED: f64 = 0.5;
/// Pairs of buildings whose parts are alike weigh so much in all, as a share of the recorded ones: such buildings are
/// rare, and all are simulated. Cross-validated: with 0.05 as many of them are merged wrongly, and fewer published maps
/// rightly; with 0.02 half as many again are wrong.
const PARTS_ALIKE: f64 = 0.03;
/// Newton's method has converged when no weight changes by more.
const CONVERGENCE: f64 = 1e-9;
const MOST_ITERATIONS: usize = 200;

/// Alternatives, of which one is right, some that are one, or none.
pub(super) struct Choice {
    pub(super) weight: f64,
    /// The values of the terms of each, and whether it is right.
    pub(super) alternatives: Vec<(Vec<f64>, bool)>,
}

/// A linear function of terms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Linear {
    pub(super) intercept: f64,
    pub(super) weights: Vec<f64>,
}

impl Linear {
    pub(super) fn of(&self, values: &[f64]) -> f64 {
        self.intercept + self.weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>()
    }

    /// The likeliest one for which each weight has its sign; a sign of 0 allows both.
    pub(super) fn fit(choices: &[Choice], signs: &[f64]) -> Result<Self> {
        let mut kept: Vec<usize> = (0..signs.len()).collect();
        loop {
            let fitted = fit_unbounded(choices, &kept)?;
            let mut weights = vec![0.0; signs.len()];
            kept.iter().zip(&fitted.weights).for_each(|(index, weight)| weights[*index] = *weight);
            // A term whose weight has the wrong sign says nothing.
            let Some(worst) = kept.iter().position(|index| weights[*index] * signs[*index] < 0.0) else {
                return Ok(Self { weights, ..fitted });
            };
            kept.remove(worst);
        }
    }
}

/// The weight of a choice, and for each alternative its scaled terms behind a 1 for the intercept, and whether it is
/// right.
type Scaled = (f64, Vec<(DVector<f64>, bool)>);

/// Newton's method on the terms that are kept, scaled to a spread of one, with the expected information.
fn fit_unbounded(choices: &[Choice], kept: &[usize]) -> Result<Linear> {
    let values = || choices.iter().flat_map(|choice| choice.alternatives.iter().map(|(values, _)| values));
    let count = values().count() as f64;
    if count == 0.0 {
        bail!("there is nothing to fit to: name folders with pairs of maps");
    }
    let moments = kept.iter().map(|index| {
        let mean = values().map(|values| values[*index]).sum::<f64>() / count;
        let variance = values().map(|values| (values[*index] - mean).powi(2)).sum::<f64>() / count;
        (mean, variance.sqrt().max(1e-9))
    });
    let moments: Vec<(f64, f64)> = moments.collect();
    // The intercept is the first.
    let scaled = |values: &[f64]| {
        let terms = kept.iter().zip(&moments).map(|(index, (mean, spread))| (values[*index] - mean) / spread);
        DVector::from_iterator(kept.len() + 1, std::iter::once(1.0).chain(terms))
    };
    let choices: Vec<Scaled> = choices
        .iter()
        .map(|choice| {
            let alternatives = choice.alternatives.iter().map(|(values, right)| (scaled(values), *right));
            (choice.weight, alternatives.collect())
        })
        .collect();
    let mut penalty = DMatrix::identity(kept.len() + 1, kept.len() + 1) * REGULARISATION;
    penalty[(0, 0)] = 0.0;
    let mut parameters = DVector::zeros(kept.len() + 1);
    let (mut loss, mut gradient, mut information) = derivatives(&choices, &parameters, &penalty);
    for _ in 0..MOST_ITERATIONS {
        let Some(step) = information.clone().cholesky().map(|cholesky| cholesky.solve(&gradient)) else {
            bail!("the terms depend on each other, so that no weights are the likeliest");
        };
        // Half of it, until it is better.
        let mut share = 1.0;
        let next = loop {
            let next = &parameters - &step * share;
            let (next_loss, next_gradient, next_information) = derivatives(&choices, &next, &penalty);
            if next_loss <= loss || share < 1e-6 {
                (loss, gradient, information) = (next_loss, next_gradient, next_information);
                break next;
            }
            share *= 0.5;
        };
        let change = (&next - &parameters).amax();
        parameters = next;
        if change < CONVERGENCE {
            break;
        }
    }
    let weights: Vec<f64> =
        moments.iter().enumerate().map(|(index, (_, spread))| parameters[index + 1] / spread).collect();
    let shift = weights.iter().zip(&moments).map(|(weight, (mean, _))| weight * mean).sum::<f64>();
    Ok(Linear { intercept: parameters[0] - shift, weights })
}

/// The negative logarithm of the likelihood, its gradient, and the expected information.
fn derivatives(
    choices: &[Scaled],
    parameters: &DVector<f64>,
    penalty: &DMatrix<f64>,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let mut loss = 0.5 * parameters.dot(&(penalty * parameters));
    let mut gradient = penalty * parameters;
    let mut information = penalty.clone();
    for (weight, alternatives) in choices {
        let log_odds: Vec<f64> = alternatives.iter().map(|(values, _)| parameters.dot(values)).collect();
        let probabilities = posterior(&log_odds);
        let none = 1.0 - probabilities.iter().sum::<f64>();
        let has_right = alternatives.iter().any(|(_, right)| *right);
        let of_right: f64 =
            alternatives.iter().zip(&probabilities).filter(|((_, right), _)| *right).map(|(_, p)| p).sum();
        let right = if has_right { of_right } else { none }.max(f64::MIN_POSITIVE);
        loss -= weight * right.ln();
        let mut mean: DVector<f64> = DVector::zeros(parameters.len());
        for ((values, is_right), probability) in alternatives.iter().zip(&probabilities) {
            let pull = probability - if *is_right { probability / right } else { 0.0 };
            gradient.axpy(weight * pull, values, 1.0);
            information.ger(weight * probability, values, values, 1.0);
            mean.axpy(*probability, values, 1.0);
        }
        information.ger(-weight, &mean, &mean, 1.0);
    }
    (loss, gradient, information)
}

/// Examples that have a total weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Group {
    /// Recorded maps that belong together.
    Recorded,
    /// Simulated maps that belong together.
    Simulated,
    /// Those of a building whose parts are alike.
    PartsAlike,
    /// Maps of different buildings.
    Different,
}

impl Group {
    fn of(example: &Example) -> Self {
        match (example.is_related, example.is_simulated()) {
            _ if example.has_parts_alike() => Self::PartsAlike,
            (false, _) => Self::Different,
            (true, true) => Self::Simulated,
            (true, false) => Self::Recorded,
        }
    }
}

/// The weights of the judgement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights {
    pub(super) places: Linear,
    pub(super) aliases: Linear,
    /// The mean of each term over right places.
    pub(super) typical: [f64; COUNT],
}

impl Weights {
    /// The likeliest ones.
    pub(super) fn fit(examples: &[&Example]) -> Result<Self> {
        // What is the right place inexactly, and what is an alias, would be taken for wrong.
        let is_clear = |example: &Example| {
            !example.places.is_empty() && !example.is_inexact() && (example.has_parts_alike() || !example.is_aliased())
        };
        let clear: Vec<&Example> = examples.iter().copied().filter(|example| is_clear(example)).collect();
        let count = |group: Group| clear.iter().filter(|example| Group::of(example) == group).count() as f64;
        let [recorded, simulated, alike, different] =
            [Group::Recorded, Group::Simulated, Group::PartsAlike, Group::Different].map(count);
        let total = if recorded > 0.0 { recorded } else { simulated / SIMULATED };
        let weight = |example: &Example| match Group::of(example) {
            Group::Recorded => 1.0,
            Group::Simulated => SIMULATED * total / simulated,
            Group::PartsAlike => PARTS_ALIKE * total / alike,
            Group::Different => (recorded + SIMULATED * total) / different,
        };
        let choice = |example: &Example| Choice {
            weight: weight(example),
            alternatives: example
                .places
                .iter()
                .map(|place| (place.terms.to_vec(), place.closeness != Closeness::Wrong))
                .collect(),
        };
        let choices: Vec<Choice> = clear.iter().map(|example| choice(example)).collect();
        let places = Linear::fit(&choices, &Term::ALL.map(Term::sign))?;
        let aliases: Vec<Choice> = examples.iter().flat_map(|example| choices_of_aliases(example, &places)).collect();
        let aliases = Linear::fit(&aliases, &[1.0, -1.0, 1.0])?;
        let right: Vec<[f64; COUNT]> = examples
            .iter()
            .flat_map(|example| &example.places)
            .filter(|place| place.closeness == Closeness::Right)
            .map(|place| place.terms)
            .collect();
        let typical = std::array::from_fn(|index| {
            right.iter().map(|terms| terms[index]).sum::<f64>() / right.len().max(1) as f64
        });
        Ok(Self { places, aliases, typical })
    }
}

/// The choices between the most probable place and each of its aliases, where one of both is right.
fn choices_of_aliases(example: &Example, places: &Linear) -> Vec<Choice> {
    let best = example.places.iter().max_by(|one, other| places.of(&one.terms).total_cmp(&places.of(&other.terms)));
    let Some(best) = best.filter(|best| best.closeness != Closeness::Wrong || example.is_aliased()) else {
        return Vec::new();
    };
    let is_right = |closeness: Closeness| closeness != Closeness::Wrong && best.closeness == Closeness::Wrong;
    let terms_and_closeness =
        example.aliases.iter().filter(|(_, closeness)| best.closeness != Closeness::Wrong || is_right(*closeness));
    terms_and_closeness
        .map(|(terms, closeness)| Choice { weight: 1.0, alternatives: vec![(terms.to_vec(), is_right(*closeness))] })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judgement::examples;
    use gridweave_stages::registration::judgement::weights::{ALIAS, INTERCEPT, TYPICAL, WEIGHTS};
    use std::path::Path;

    #[test]
    fn the_weights_that_ship_are_those_of_the_examples_that_are_kept_beside() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/results/judgement_examples.jsonl");
        let examples = examples::read(&file).unwrap();
        let fitted = Weights::fit(&examples.iter().collect::<Vec<_>>()).unwrap();
        let Linear { intercept, weights } = &fitted.aliases;
        let found =
            [&[fitted.places.intercept], fitted.places.weights.as_slice(), &fitted.typical, &[*intercept], weights];
        let shipped = [&[INTERCEPT], WEIGHTS.as_slice(), &TYPICAL, &ALIAS];
        for (found, shipped) in found.concat().iter().zip(shipped.concat()) {
            assert!((found - shipped).abs() <= 1e-3 * (1.0 + shipped.abs()), "{fitted:?}");
        }
    }

    /// One alternative for each choice, right with the probability of a known function of two terms.
    fn choices() -> Vec<Choice> {
        let place = |number: u32| {
            let (x, y) = (f64::from(number % 21) - 10.0, f64::from(number / 21 % 21) - 10.0);
            let probability = 1.0 / (1.0 + (1.0 - 0.5 * x).exp());
            let alternatives = |right: bool| vec![(vec![x, y], right)];
            [(probability, true), (1.0 - probability, false)]
                .map(|(weight, right)| Choice { weight, alternatives: alternatives(right) })
        };
        (0..441).flat_map(place).collect()
    }

    #[test]
    fn a_known_function_is_found() {
        let found = Linear::fit(&choices(), &[0.0, 0.0]).unwrap();
        assert!((found.intercept + 1.0).abs() < 0.1 && (found.weights[0] - 0.5).abs() < 0.05, "{found:?}");
        assert!(found.weights[1].abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn a_weight_of_the_wrong_sign_is_left_out() {
        let found = Linear::fit(&choices(), &[-1.0, 0.0]).unwrap();
        assert_eq!(found.weights[0], 0.0);
        assert!(Linear::fit(&[], &[1.0]).is_err());
    }

    #[test]
    fn of_alternatives_the_one_with_more_of_a_term_is_preferred() {
        let choice = |first: f64, second: f64| Choice {
            weight: 1.0,
            alternatives: vec![(vec![first], first > second), (vec![second], second > first)],
        };
        let choices: Vec<Choice> =
            (0..20).map(|number| choice(f64::from(number % 5), f64::from(number % 3) + 0.5)).collect();
        assert!(Linear::fit(&choices, &[1.0]).unwrap().weights[0] > 0.5);
    }
}

//! A random walk with adapting variance towards the least value of a function of three variables.

use super::RandomWalkParameters;
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::collections::VecDeque;

/// Where a walk has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkEnd {
    /// The best place that it came to.
    pub place: Vector3<f64>,
    /// The value there.
    pub value: f64,
    /// How far the last accepted moves led from there: the mean of the products of their components.
    pub spread: Matrix3<f64>,
    /// How many places were tried.
    pub trials: usize,
}

/// Walks from a place to one where `value` is small.
///
/// A trial is a move drawn from a normal distribution. It is accepted if it makes the value less and, with probability
/// `accept_worse`, if it does not. The mean and the deviations of the distribution are those of the last accepted moves
/// (the adaptive random walk of Carpin and Birk), at least `least` along each axis and at most the `first`. The papers
/// leave open what follows when no move is accepted any more: here the deviations are halved after as many refusals in
/// a row as the history is long.
pub fn walk(
    start: Vector3<f64>,
    first: &Vector3<f64>,
    least: &Vector3<f64>,
    parameters: &RandomWalkParameters,
    random: &mut impl Rng,
    value: impl Fn(&Vector3<f64>) -> f64,
) -> WalkEnd {
    let (mut place, mut value_here) = (start, value(&start));
    let (mut best, mut value_best) = (place, value_here);
    let (mut mean, mut deviations) = (Vector3::zeros(), *first);
    let mut moves: VecDeque<Vector3<f64>> = VecDeque::with_capacity(parameters.history);
    let (mut trials, mut since_best, mut refused) = (0, 0, 0);
    while trials < parameters.max_trials && since_best < parameters.patience {
        trials += 1;
        since_best += 1;
        let drawn = Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal));
        let step = mean + deviations.component_mul(&drawn);
        let there = place + step;
        let value_there = value(&there);
        let accepts_worse = random.random::<f64>() < parameters.accept_worse;
        if value_there < value_here || accepts_worse && value_there.is_finite() {
            (place, value_here, refused) = (there, value_there, 0);
            if moves.len() == parameters.history {
                moves.pop_front();
            }
            moves.push_back(step);
            (mean, deviations) = moments(&moves, first, least);
        } else {
            refused += 1;
        }
        if refused >= parameters.history {
            (mean, deviations, refused) = (Vector3::zeros(), (deviations / 2.0).sup(least), 0);
        }
        if value_here < value_best {
            (best, value_best, since_best) = (place, value_here, 0);
        }
    }
    let spread = moves.iter().map(|step| step * step.transpose()).sum::<Matrix3<f64>>() / moves.len().max(1) as f64;
    WalkEnd { place: best, value: value_best, spread, trials }
}

/// The mean of moves, and their deviations within bounds. Of few moves nothing is known: the first deviations stand.
fn moments(moves: &VecDeque<Vector3<f64>>, first: &Vector3<f64>, least: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    if moves.len() < 3 {
        return (Vector3::zeros(), *first);
    }
    let count = moves.len() as f64;
    let mean = moves.iter().sum::<Vector3<f64>>() / count;
    let squares = moves.iter().map(|step| (step - mean).component_mul(&(step - mean))).sum::<Vector3<f64>>() / count;
    (mean, squares.map(f64::sqrt).sup(least).inf(first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// The distance from a place, where 1 of the third counts as 10 of the others.
    fn bowl(place: &Vector3<f64>) -> f64 {
        let from = place - Vector3::new(1.0, -2.0, 0.3);
        Vector3::new(from.x, from.y, 10.0 * from.z).norm()
    }

    fn run(parameters: &RandomWalkParameters, seed: u64, value: impl Fn(&Vector3<f64>) -> f64) -> WalkEnd {
        let (first, least) = (Vector3::new(2.0, 2.0, 0.2), Vector3::new(0.01, 0.01, 0.001));
        walk(Vector3::zeros(), &first, &least, parameters, &mut ChaCha8Rng::seed_from_u64(seed), value)
    }

    #[test]
    fn it_comes_to_the_bottom_of_a_bowl_and_the_same_seed_goes_the_same_way() {
        let parameters =
            RandomWalkParameters { accept_worse: 0.0, max_trials: 4000, patience: 600, ..Default::default() };
        for seed in 0..10 {
            let end = run(&parameters, seed, bowl);
            assert!(end.value < 0.03 && bowl(&end.place) == end.value, "{end:?}");
            assert!(end.spread.iter().all(|value| value.is_finite()), "{end:?}");
            assert_eq!(end, run(&parameters, seed, bowl));
        }
        assert_ne!(run(&parameters, 1, bowl), run(&parameters, 2, bowl));
    }

    #[test]
    fn it_ends_by_its_bounds() {
        let parameters = RandomWalkParameters { max_trials: 50, patience: 1000, ..Default::default() };
        assert_eq!(run(&parameters, 1, bowl).trials, 50);
        let parameters = RandomWalkParameters { max_trials: 5000, patience: 70, ..Default::default() };
        assert_eq!(run(&parameters, 1, |_| 1.0).trials, 70, "on a plain there is nothing better");
        let nothing = run(&parameters, 1, |_| f64::NAN);
        assert_eq!((nothing.trials, nothing.place, nothing.spread), (70, Vector3::zeros(), Matrix3::zeros()));
    }

    #[test]
    fn it_leaves_a_local_minimum_only_if_worse_moves_may_be_accepted() {
        let comb = |place: &Vector3<f64>| (place.x - 6.0).abs() + 3.0 * (1.0 - (4.0 * place.x).cos()) + place.y.abs();
        let found = |accept_worse| {
            let parameters =
                RandomWalkParameters { accept_worse, max_trials: 20_000, patience: 20_000, ..Default::default() };
            // Moves are always as long, and too short to cross from one minimum to the next.
            let moves = Vector3::new(0.2, 0.2, 0.2);
            let random = &mut ChaCha8Rng::seed_from_u64(3);
            walk(Vector3::zeros(), &moves, &moves, &parameters, random, comb).value
        };
        assert!(found(0.0) > 5.0 && found(0.1) < 4.5, "{} {}", found(0.0), found(0.1));
    }
}

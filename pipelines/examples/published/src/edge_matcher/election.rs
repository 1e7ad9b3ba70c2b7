//! The translation with most votes.

use super::Vote;
use nalgebra::{Matrix2, Vector2};

/// Rounds in which the centre of the votes is moved to their mean.
const ROUNDS: usize = 5;

/// Least distance of the second-best translation, in radii.
const ELSEWHERE: f64 = 3.0;

/// Result of a vote.
#[derive(Clone, Debug, PartialEq)]
pub struct Election {
    /// Mean of the votes for the winning translation, metres.
    pub translation: Vector2<f64>,
    /// Covariance of these votes, square metres.
    pub spread: Matrix2<f64>,
    /// Indices of these votes in the list.
    pub votes: Vec<usize>,
    /// Their weight, metres.
    pub weight: f64,
    /// Weight of the votes for the second-best translation.
    pub weight_elsewhere: f64,
}

impl Election {
    /// Counts votes; those within `radius` metres are for the same translation. `None` without votes.
    pub fn of(votes: &[Vote], radius: f64) -> Option<Self> {
        // Sorted by x, so that the neighbours of a vote are near it in the list.
        let mut by_x: Vec<usize> = (0..votes.len()).collect();
        by_x.sort_by(|one, other| {
            votes[*one].translation.x.total_cmp(&votes[*other].translation.x).then(one.cmp(other))
        });
        let near = |place: &Vector2<f64>| {
            let first = by_x.partition_point(|vote| votes[*vote].translation.x < place.x - radius);
            let (place, end) = (*place, place.x + radius);
            by_x[first..]
                .iter()
                .copied()
                .take_while(move |vote| votes[*vote].translation.x <= end)
                .filter(move |vote| (votes[*vote].translation - place).norm() <= radius)
        };
        let weight = |place: &Vector2<f64>| near(place).map(|vote| votes[vote].weight).sum::<f64>();
        let weights: Vec<f64> = votes.iter().map(|vote| weight(&vote.translation)).collect();
        // Of equals the first.
        let best_of = |places: &mut dyn Iterator<Item = usize>| {
            places.fold(None, |best: Option<usize>, one| match best {
                Some(best) if weights[best] >= weights[one] => Some(best),
                _ => Some(one),
            })
        };
        let winner = best_of(&mut (0..votes.len()))?;
        let mean = |place: &Vector2<f64>| {
            let total = weight(place);
            let sum =
                near(place).fold(Vector2::zeros(), |sum, vote| sum + votes[vote].translation * votes[vote].weight);
            if total > 0.0 { sum / total } else { *place }
        };
        let translation = (0..ROUNDS).fold(votes[winner].translation, |place, _| mean(&place));
        let is_elsewhere = |vote: &usize| (votes[*vote].translation - translation).norm() > ELSEWHERE * radius;
        let elsewhere = best_of(&mut (0..votes.len()).filter(is_elsewhere));
        let mut taking_part: Vec<usize> = near(&translation).collect();
        taking_part.sort_unstable();
        let total: f64 = taking_part.iter().map(|vote| votes[*vote].weight).sum();
        let spread = taking_part.iter().fold(Matrix2::zeros(), |sum, vote| {
            let off = votes[*vote].translation - translation;
            let share = if total > 0.0 { votes[*vote].weight / total } else { 0.0 };
            sum + off * off.transpose() * share
        });
        Some(Self {
            translation,
            spread,
            votes: taking_part,
            weight: total,
            weight_elsewhere: elsewhere.map_or(0.0, |vote| weights[vote]),
        })
    }

    /// Weight of the second-best translation as a share of that of the winner.
    pub fn second_best(&self) -> f64 {
        if self.weight > 0.0 { self.weight_elsewhere / self.weight } else { 1.0 }
    }
}

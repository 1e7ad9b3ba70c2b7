//! Exhaustive search: every node on every node, at every turn.

use super::candidates::{Candidates, Trial, most_anywhere};
use super::matched_pose::distinct;
use super::{MatchedPose, Topology, TopologyMatcherParameters};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, UnitComplex, Vector2};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::f64::consts::TAU;

/// Number of poses that are refined for each requested one: some of them turn out to be the same.
const PLACES_FOR_EACH: usize = 2;

/// Trials of a turn that are counted before it is looked whether others can be better; then twice as many each time.
const FIRST_TRIALS: usize = 64;

/// Turns that are tried beside each other before it is looked whether others can be better.
const TURNS_AT_ONCE: usize = 8;

/// Pairs of paths that coincide at one translation, at most, for each path that the parameters allow: of two maps whose
/// nodes lie farther apart than the tolerance, a path coincides with one of the other map.
const PAIRS_FOR_EACH_PATH: usize = 4;

/// Too many paths of two maps lie within the tolerance of each other to be counted at every trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "up to {pairs} pairs of paths of the topological maps lie within the tolerance of each other at one place, and at \
     most {most} are compared ({PAIRS_FOR_EACH_PATH} for each of the paths that max_nodes allows)\n\
     try: nodes that lie farther apart than the tolerance, or a smaller tolerance"
)]
pub struct TooDense {
    /// Pairs of paths that may coincide at one place.
    pub pairs: usize,
    /// How many are compared.
    pub most: usize,
}

/// Result of the exhaustive search.
#[derive(Clone, Debug, PartialEq)]
pub struct Exhaustive {
    /// Number of trials: nodes of a, times nodes of b, times turns.
    pub trials: u64,
    /// The best poses, each apart from the others.
    pub poses: Vec<MatchedPose>,
}

/// Turns map b by steps from 0 to 360 degrees, including both, and at each turn puts every node of it on every node
/// of map a; returns the poses at which most pairs of paths coincide (equation 2). Steps of 2 degrees are 181 turns;
/// 4 and 7 nodes are then 5068 trials.
///
/// Paths that could coincide at a turn, at any translation, are few. They are found first, and say how many paths can
/// coincide there at most. Turns and translations at which most can are tried first, and none at which fewer can than
/// do at the poses that are kept: the result is that of all trials.
///
/// # Errors
/// So many paths lie within the tolerance of each other that the search would not end in time.
pub fn exhaustive(a: &Topology, b: &Topology, parameters: &TopologyMatcherParameters) -> Result<Exhaustive, TooDense> {
    let turns = (TAU / parameters.turn_step).round() as usize + 1;
    let trials = (a.nodes.len() * b.nodes.len()) as u64 * turns as u64;
    let most = PLACES_FOR_EACH * parameters.max_hypotheses;
    let rotation = |turn: usize| UnitComplex::new(turn as f64 * parameters.turn_step);
    let bounds: Vec<usize> =
        (0..turns).into_par_iter().map(|turn| most_of_turn(a, b, rotation(turn), parameters)).collect();
    let densest = TooDense {
        pairs: bounds.iter().copied().max().unwrap_or(0),
        most: PAIRS_FOR_EACH_PATH * parameters.max_paths(),
    };
    if densest.pairs > densest.most {
        return Err(densest);
    }
    let mut order: Vec<usize> = (0..turns).filter(|turn| bounds[*turn] > 0).collect();
    order.sort_by_key(|turn| Reverse(bounds[*turn]));
    let mut found: Vec<(usize, MatchedPose)> = Vec::new();
    let mut best = Vec::new();
    for some in order.chunks(TURNS_AT_ONCE) {
        // Turns at which no trial can be as good as those that are kept are left out.
        let least = best.last().filter(|_| best.len() == most).map_or(0, |pose: &MatchedPose| pose.similarity);
        if bounds[some[0]] < least {
            break;
        }
        found.par_extend(some.par_iter().flat_map_iter(|&turn| {
            let trials = best_of_turn(a, b, rotation(turn), most, least, parameters);
            trials.into_iter().map(move |trial| (turn, trial.matched_pose(rotation(turn))))
        }));
        found.sort_by_key(|(turn, _)| *turn);
        best = distinct(found.iter().map(|(_, pose)| pose.clone()).collect(), most, b, parameters);
    }
    let poses = best
        .into_iter()
        .filter_map(|matched_pose| MatchedPose::at(a, b, matched_pose.transform_a_b, parameters))
        .collect();
    Ok(Exhaustive { trials, poses: distinct(poses, parameters.max_hypotheses, b, parameters) })
}

impl Trial {
    /// As a pose without a covariance.
    fn matched_pose(&self, rotation: UnitComplex<f64>) -> MatchedPose {
        MatchedPose {
            transform_a_b: Pose2::from_parts(self.translation.into(), rotation),
            covariance: Matrix3::zeros(),
            similarity: self.similarity,
            rms: (self.distance / (2 * self.similarity) as f64).sqrt(),
        }
    }
}

/// The most paths that can coincide at a turn, at any translation.
fn most_of_turn(
    a: &Topology,
    b: &Topology,
    rotation: UnitComplex<f64>,
    parameters: &TopologyMatcherParameters,
) -> usize {
    most_anywhere(a, b, &turned(b, rotation), parameters.tolerance)
}

/// The nodes of map b after a turn.
fn turned(b: &Topology, rotation: UnitComplex<f64>) -> Vec<Vector2<f64>> {
    b.nodes.iter().map(|node| rotation * node.coords).collect()
}

/// At most `most` trials at which most paths coincide at a turn, each apart from the others; those at which fewer than
/// `least` paths coincide may be missing.
fn best_of_turn(
    a: &Topology,
    b: &Topology,
    rotation: UnitComplex<f64>,
    most: usize,
    least: usize,
    parameters: &TopologyMatcherParameters,
) -> Vec<Trial> {
    let turned = turned(b, rotation);
    let candidates = Candidates::new(a, b, &turned, parameters.tolerance);
    let translations = a.nodes.iter().flat_map(|node| turned.iter().map(move |turned| node.coords - turned));
    // The trial of a translation counts at most so many paths: those that can count most are counted first.
    let mut left: Vec<(usize, usize, Vector2<f64>)> = translations
        .enumerate()
        .map(|(number, translation)| (candidates.most_at(&translation), number, translation))
        .filter(|(most, ..)| *most >= least.max(1))
        .collect();
    left.sort_unstable_by_key(|(most, number, _)| (Reverse(*most), *number));
    let mut counted: Vec<(usize, Trial)> = Vec::new();
    let mut rest = left.as_slice();
    loop {
        let (next, later) = rest.split_at(rest.len().min(FIRST_TRIALS.max(left.len() - rest.len())));
        counted.extend(next.iter().map(|(_, number, translation)| (*number, candidates.trial(*translation))));
        counted.retain(|(_, trial)| trial.similarity > 0);
        counted.sort_unstable_by(|(first, one), (second, other)| {
            let by_similarity = other.similarity.cmp(&one.similarity);
            by_similarity.then(one.distance.total_cmp(&other.distance)).then(first.cmp(second))
        });
        let best = apart(&counted, most, parameters.apart);
        let worst = best.last().filter(|_| best.len() == most).map_or(0, |trial| trial.similarity);
        if later.first().is_none_or(|(most, ..)| *most < worst) {
            return best;
        }
        rest = later;
    }
}

/// At most `most` trials, the first ones that lie more than a distance apart from those before them.
fn apart(sorted: &[(usize, Trial)], most: usize, distance: f64) -> Vec<Trial> {
    let mut best: Vec<Trial> = Vec::new();
    for (_, trial) in sorted {
        if best.len() == most {
            break;
        }
        if best.iter().all(|better| (better.translation - trial.translation).norm() > distance) {
            best.push(*trial);
        }
    }
    best
}

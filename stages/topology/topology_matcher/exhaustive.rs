//! Exhaustive search: every node on every node, at every turn.

use super::matched_pose::distinct;
use super::{MatchedPose, Topology, TopologyMatcherParameters};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, UnitComplex, Vector2};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Number of poses that are refined for each requested one: some of them turn out to be the same.
const PLACES_FOR_EACH: usize = 2;

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
/// Paths that could coincide at a turn, at any translation, are few. They are found first, and counted at each trial.
pub fn exhaustive(a: &Topology, b: &Topology, parameters: &TopologyMatcherParameters) -> Exhaustive {
    let turns = (TAU / parameters.turn_step).round() as usize + 1;
    let trials = (a.nodes.len() * b.nodes.len()) as u64 * turns as u64;
    let most = PLACES_FOR_EACH * parameters.max_hypotheses;
    let best: Vec<MatchedPose> = (0..turns)
        .into_par_iter()
        .flat_map_iter(|turn| {
            let rotation = UnitComplex::new(turn as f64 * parameters.turn_step);
            let best = best_of_turn(a, b, rotation, most, parameters);
            best.into_iter().map(move |trial| trial.matched_pose(rotation))
        })
        .collect();
    let best = distinct(best, most, b, parameters);
    let poses = best
        .into_iter()
        .filter_map(|matched_pose| MatchedPose::at(a, b, matched_pose.transform_a_b, parameters))
        .collect();
    Exhaustive { trials, poses: distinct(poses, parameters.max_hypotheses, b, parameters) }
}

/// Two paths that coincide at some translation: those that align their first and their second ends.
#[derive(Clone, Copy)]
struct Candidate {
    first: Vector2<f64>,
    second: Vector2<f64>,
}

/// A trial at which paths coincide.
#[derive(Clone, Copy)]
struct Trial {
    translation: Vector2<f64>,
    similarity: usize,
    /// Of the ends of the paths that coincide, squared and summed up.
    distance: f64,
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

/// At most `most` trials at which most paths coincide at a turn, each apart from the others.
fn best_of_turn(
    a: &Topology,
    b: &Topology,
    rotation: UnitComplex<f64>,
    most: usize,
    parameters: &TopologyMatcherParameters,
) -> Vec<Trial> {
    let turned: Vec<Vector2<f64>> = b.nodes.iter().map(|node| rotation * node.coords).collect();
    let candidates = candidates(a, b, &turned, parameters.tolerance);
    if candidates.is_empty() {
        return Vec::new();
    }
    let trials = a.nodes.iter().flat_map(|node| turned.iter().map(move |turned| node.coords - turned));
    let mut trials: Vec<Trial> = trials
        .map(|translation| trial(translation, &candidates, parameters.tolerance))
        .filter(|trial| trial.similarity > 0)
        .collect();
    trials.sort_by(|one, other| other.similarity.cmp(&one.similarity).then(one.distance.total_cmp(&other.distance)));
    let mut best: Vec<Trial> = Vec::new();
    for trial in &trials {
        if best.len() == most {
            break;
        }
        if best.iter().all(|better| (better.translation - trial.translation).norm() > parameters.apart) {
            best.push(*trial);
        }
    }
    best
}

/// All pairs of paths that coincide at some translation, by the x of the translation in their middle.
fn candidates(a: &Topology, b: &Topology, turned: &[Vector2<f64>], tolerance: f64) -> Vec<Candidate> {
    let mut found = Vec::new();
    let paths_a: Vec<[usize; 2]> = a.long_paths(tolerance).collect();
    for [start, end] in b.long_paths(tolerance) {
        let along = turned[end] - turned[start];
        for ends in &paths_a {
            let [first, second] = ends.map(|node| a.nodes[node].coords);
            let across = second - first;
            let mut add = |start: usize, end: usize| {
                found.push(Candidate { first: first - turned[start], second: second - turned[end] });
            };
            if (across - along).norm() <= 2.0 * tolerance {
                add(start, end);
            }
            if (across + along).norm() <= 2.0 * tolerance {
                add(end, start);
            }
        }
    }
    found.sort_by(|one, other| one.middle_x().total_cmp(&other.middle_x()));
    found
}

impl Candidate {
    fn middle_x(&self) -> f64 {
        0.5 * (self.first.x + self.second.x)
    }
}

/// Counts the paths that coincide at a translation.
fn trial(translation: Vector2<f64>, candidates: &[Candidate], tolerance: f64) -> Trial {
    let mut trial = Trial { translation, similarity: 0, distance: 0.0 };
    // If both ends are within the tolerance, so is their midpoint.
    let start = candidates.partition_point(|candidate| candidate.middle_x() < translation.x - tolerance);
    let near = candidates[start..].iter().take_while(|candidate| candidate.middle_x() <= translation.x + tolerance);
    let most = tolerance * tolerance;
    for candidate in near {
        let first = (candidate.first - translation).norm_squared();
        let second = (candidate.second - translation).norm_squared();
        if first <= most && second <= most {
            trial.similarity += 1;
            trial.distance += first + second;
        }
    }
    trial
}

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
    let candidates = Candidates::new(a, b, &turned, parameters.tolerance);
    if candidates.sorted.is_empty() {
        return Vec::new();
    }
    let trials = a.nodes.iter().flat_map(|node| turned.iter().map(move |turned| node.coords - turned));
    let mut trials: Vec<Trial> =
        trials.map(|translation| candidates.trial(translation)).filter(|trial| trial.similarity > 0).collect();
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

/// The pairs of paths that coincide at some translation, in columns of the translation in their middle.
struct Candidates {
    /// By column, then by y.
    sorted: Vec<Candidate>,
    tolerance: f64,
}

impl Candidates {
    fn new(a: &Topology, b: &Topology, turned: &[Vector2<f64>], tolerance: f64) -> Self {
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
        found.sort_by(|one, other| {
            let by_column = column(one.middle().x, tolerance).cmp(&column(other.middle().x, tolerance));
            by_column.then(one.middle().y.total_cmp(&other.middle().y))
        });
        Self { sorted: found, tolerance }
    }

    /// Counts the paths that coincide at a translation.
    fn trial(&self, translation: Vector2<f64>) -> Trial {
        let mut trial = Trial { translation, similarity: 0, distance: 0.0 };
        let most = self.tolerance * self.tolerance;
        // If both ends are within the tolerance, so is their midpoint.
        let [left, right] = [-1.0, 1.0].map(|side| column(translation.x + side * self.tolerance, self.tolerance));
        for at in [Some(left), (right > left).then_some(right)].into_iter().flatten() {
            for candidate in self.between(at, translation.y - self.tolerance, translation.y + self.tolerance) {
                let first = (candidate.first - translation).norm_squared();
                let second = (candidate.second - translation).norm_squared();
                if first <= most && second <= most {
                    trial.similarity += 1;
                    trial.distance += first + second;
                }
            }
        }
        trial
    }

    /// The candidates of a column from one y to another.
    fn between(&self, at: i64, lowest: f64, highest: f64) -> impl Iterator<Item = &Candidate> {
        let start = self.sorted.partition_point(|candidate| {
            let middle = candidate.middle();
            let by_column = column(middle.x, self.tolerance).cmp(&at);
            by_column.then(middle.y.total_cmp(&lowest)).is_lt()
        });
        let is_within = move |candidate: &&Candidate| {
            column(candidate.middle().x, self.tolerance) == at && candidate.middle().y <= highest
        };
        self.sorted[start..].iter().take_while(is_within)
    }
}

/// The column of an x: columns are as wide as what lies within the tolerance of a point.
fn column(x: f64, tolerance: f64) -> i64 {
    (x / (2.0 * tolerance)).floor() as i64
}

impl Candidate {
    fn middle(&self) -> Vector2<f64> {
        0.5 * (self.first + self.second)
    }
}

//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::PI;

/// Parameters of the random walk aligner. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RandomWalkParameters {
    /// The side of a cell in which distances are taken, metres; never less than one and a half cells of either map.
    pub cell: f64,
    /// At most so many cells of each class and map take part in the dissimilarity psi, evenly chosen.
    pub max_points: usize,
    /// So many walks are made for each pair of maps, which begin at rotations all round, with the middles of the maps on each other.
    pub walks: usize,
    /// A walk ends after so many trials.
    pub max_trials: usize,
    /// A walk ends when it has found nothing better in so many trials.
    pub patience: usize,
    /// The standard deviation of the first moves in x and in y, metres.
    pub first_move: f64,
    /// The standard deviation of the first turns, radians.
    pub first_turn: f64,
    /// The mean and the deviations of further moves are those of so many accepted ones before; after as many refusals in a row
    /// the deviations are halved.
    pub history: usize,
    /// The probability that a move is accepted which makes psi worse, so that a walk can leave a local minimum, 0 to 1.
    pub accept_worse: f64,
    /// Places are the same if the middle of the map is moved by less than this, metres, and it is turned by less than `apart_yaw`.
    pub apart: f64,
    /// See `apart`, radians.
    pub apart_yaw: f64,
    /// The least acceptance index omega at which the best place is accepted, 0 to 1. In maps that were drawn from laser scans in six
    /// buildings, pairs that came to lie rightly had 0.97 and more, and maps of different buildings up to 0.951; other maps, of
    /// mostly free space, have more at wrong places.
    pub min_omega: f64,
    /// The least share of the smaller map of which the other must say something, 0 to 1. The papers ask for none, and maps
    /// that share a few cells nearly always agree on them.
    pub min_overlap: f64,
    /// At most so many places are sent for a pair of maps.
    pub max_hypotheses: usize,
    /// A map whose known part is longer than this in x or in y is not aligned, metres.
    pub max_extent: f64,
}

impl Default for RandomWalkParameters {
    fn default() -> Self {
        Self {
            cell: 0.1,
            max_points: 300,
            walks: 16,
            max_trials: 1500,
            patience: 300,
            first_move: 2.0,
            first_turn: 0.2,
            history: 20,
            accept_worse: 0.01,
            apart: 1.0,
            apart_yaw: PI / 18.0,
            min_omega: 0.96,
            min_overlap: 0.1,
            max_hypotheses: 4,
            max_extent: 400.0,
        }
    }
}

impl Parameters for RandomWalkParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let ranges = [
            ("cell", self.cell, 0.01, 10.0),
            ("first_move", self.first_move, 1e-3, 1e3),
            ("first_turn", self.first_turn, 1e-3, PI),
            ("accept_worse", self.accept_worse, 0.0, 1.0),
            ("apart", self.apart, 0.0, 1e6),
            ("apart_yaw", self.apart_yaw, 0.0, PI),
            ("min_omega", self.min_omega, 0.0, 1.0),
            ("min_overlap", self.min_overlap, 0.0, 1.0),
            ("max_extent", self.max_extent, 1.0, 1e4),
        ];
        for (field, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between {least} and {most}, not {value}")));
            }
        }
        let counts = [
            ("max_points", self.max_points, 1_000_000),
            ("walks", self.walks, 10_000),
            ("max_trials", self.max_trials, 10_000_000),
            ("patience", self.patience, 10_000_000),
            ("history", self.history, 10_000),
            ("max_hypotheses", self.max_hypotheses, 1000),
        ];
        for (field, value, most) in counts {
            if !(1..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between 1 and {most}, not {value}")));
            }
        }
        // Beyond that, tables of distances do not fit in memory.
        if self.max_extent / self.cell > 1e4 {
            errors.push(ParameterError::new("max_extent", "must be at most 10000 cells"));
        }
        errors
    }
}

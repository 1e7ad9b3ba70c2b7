//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// How places are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MatchingMethod {
    /// Every node on every node, at every turn.
    Exhaustive,
    /// Iterative closest points on the nodes.
    IcpSvd,
}

/// Parameters of the topology matcher. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyMatcherParameters {
    /// How places are found: `exhaustive` tries every node on every node at every turn; `icp_svd` goes from the centres of the
    /// maps to the nearest optimum, and leads astray where the maps show only parts of each other.
    pub method: MatchingMethod,
    /// Two paths coincide if both of their ends lie within this distance of each other, metres. Paths that are no
    /// longer than twice this lie on each other anywhere, and do not count.
    pub tolerance: f64,
    /// `exhaustive`: the turns from 0 to 360 degrees lie so far apart, radians.
    pub turn_step: f64,
    /// `icp_svd`: a run ends when the sum of the squared distances from nodes to their nearest nodes changes by less than
    /// this, square metres.
    pub tau: f64,
    /// `icp_svd`: how many turns, evenly spread, a run is started from. The published method knows one, without a turn.
    pub starts: usize,
    /// `icp_svd`: a run that has not come to an end by then is broken off.
    pub max_iterations: usize,
    /// Whether a place that was found is made exact on the ends of the paths that coincide there. `false` leaves it where it
    /// was found, as published.
    pub refine: bool,
    /// The standard deviation of the position of a node along x and along y, metres: what the covariance rests on.
    pub node_stddev: f64,
    /// At most so many places are told of, each away from the others.
    pub max_hypotheses: usize,
    /// Another place differs from the best by a turn of more than this, radians, or by `apart`.
    pub apart_yaw: f64,
    /// Another place differs from the best by more than this in the middle of the nodes, metres, or by `apart_yaw`.
    pub apart: f64,
    /// The best place is accepted if at least so many pairs of paths coincide there, and `min_share` and `max_runner_up` hold.
    pub min_paths: usize,
    /// The best place is accepted if at least this share of the paths of the map that has fewer coincide with paths of the
    /// other, 0 to 1, and `min_paths` and `max_runner_up` hold.
    pub min_share: f64,
    /// The best place is accepted if at the best other place at most this share of as many pairs of paths coincide, 0 to
    /// 1, and `min_paths` and `min_share` hold.
    pub max_runner_up: f64,
    /// Maps with more nodes than this are not matched: time grows with the square of their number, and faster.
    pub max_nodes: usize,
}

impl Default for TopologyMatcherParameters {
    fn default() -> Self {
        Self {
            method: MatchingMethod::Exhaustive,
            tolerance: 0.5,
            turn_step: TAU / 180.0,
            tau: 0.1,
            starts: 12,
            max_iterations: 100,
            refine: true,
            node_stddev: 0.15,
            max_hypotheses: 4,
            apart_yaw: TAU / 36.0,
            apart: 1.0,
            min_paths: 6,
            min_share: 0.15,
            max_runner_up: 0.6,
            max_nodes: 400,
        }
    }
}

impl Parameters for TopologyMatcherParameters {
    fn check(&self) -> Vec<ParameterError> {
        let ranges = [
            ("tolerance", self.tolerance, 1e-3, 100.0),
            ("turn_step", self.turn_step, 1e-3, PI),
            ("tau", self.tau, 0.0, 1e6),
            ("node_stddev", self.node_stddev, 1e-3, 100.0),
            ("apart_yaw", self.apart_yaw, 0.0, PI),
            ("apart", self.apart, 0.0, 1e6),
            ("min_share", self.min_share, 0.0, 1.0),
            ("max_runner_up", self.max_runner_up, 0.0, 1.0),
        ];
        let wrong = ranges.into_iter().filter(|(_, value, least, most)| !(*least..=*most).contains(value));
        let error = |(field, value, least, most)| {
            ParameterError::new(field, format!("must lie between {least} and {most}, not {value}"))
        };
        let mut errors: Vec<ParameterError> = wrong.map(error).collect();
        let counts = [
            ("starts", self.starts, 1000),
            ("max_iterations", self.max_iterations, 100_000),
            ("max_hypotheses", self.max_hypotheses, 1000),
            ("max_nodes", self.max_nodes, 2000),
        ];
        for (field, value, most) in counts {
            if !(1..=most).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between 1 and {most}, not {value}")));
            }
        }
        errors
    }
}

//! The parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// How places are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MatchingMethod {
    /// Every node on every node, at every turn.
    Exhaustive,
    /// Iterative closest points on the nodes.
    IcpSvd,
}

/// Parameters of the topology matcher. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyMatcherParameters {
    /// How places are found: `exhaustive` tries every node on every node at every turn; `icp_svd` goes from the centres of the
    /// maps to the nearest optimum, and leads astray where the maps show only parts of each other.
    pub method: MatchingMethod,
    /// Two paths coincide if both of their ends lie within this distance of each other, metres. Paths that are no
    /// longer than twice this lie on each other anywhere, and do not count.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub tolerance: f64,
    /// `exhaustive`: the turns from 0 to 360 degrees lie so far apart, radians.
    #[schemars(range(min = 1e-3, max = PI))]
    pub turn_step: f64,
    /// `icp_svd`: a run ends when the sum of the squared distances from nodes to their nearest nodes changes by less than
    /// this, square metres.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tau: f64,
    /// `icp_svd`: how many turns, evenly spread, a run is started from. The published method knows one, without a turn.
    #[schemars(range(min = 1, max = 1000))]
    pub starts: usize,
    /// `icp_svd`: a run that has not come to an end by then is broken off.
    #[schemars(range(min = 1, max = 100000))]
    pub max_iterations: usize,
    /// Whether a place that was found is made exact on the ends of the paths that coincide there. `false` leaves it where it
    /// was found, as published.
    pub refine: bool,
    /// The standard deviation of the position of a node along x and along y, metres: what the covariance rests on.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub node_stddev: f64,
    /// At most so many places are told of, each away from the others.
    #[schemars(range(min = 1, max = 1000))]
    pub max_hypotheses: usize,
    /// Another place differs from the best by a turn of more than this, radians, or by `apart`.
    #[schemars(range(min = 0.0, max = PI))]
    pub apart_yaw: f64,
    /// Another place differs from the best by more than this in the middle of the nodes, metres, or by `apart_yaw`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// The best place is accepted if at least so many pairs of paths coincide there, and `min_share` and `max_runner_up` hold.
    pub min_paths: usize,
    /// The best place is accepted if at least this share of the paths of the map that has fewer coincide with paths of the
    /// other, 0 to 1, and `min_paths` and `max_runner_up` hold.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_share: f64,
    /// The best place is accepted if at the best other place at most this share of as many pairs of paths coincide, 0 to
    /// 1, and `min_paths` and `min_share` hold.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_runner_up: f64,
    /// Maps with more nodes than this are not matched: time grows with the square of their number, and faster.
    #[schemars(range(min = 1, max = 2000))]
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

impl Parameters for TopologyMatcherParameters {}

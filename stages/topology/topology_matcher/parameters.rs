//! Parameters of the stage.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// How relative poses are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MatchingMethod {
    /// Every node on every node, at every turn.
    Exhaustive,
    /// Iterative closest points on the nodes.
    IcpSvd,
}

/// Parameters of the topology matcher. Functions expect values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyMatcherParameters {
    /// How relative poses are found: `exhaustive` tries every node on every node at every turn; `icp_svd` converges
    /// from the centres of the maps to the nearest optimum, and fails where the maps show only parts of each other.
    pub method: MatchingMethod,
    /// Two paths coincide if both of their ends are within this distance of each other, metres. Paths that are no
    /// longer than twice this coincide anywhere, and do not count.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub tolerance: f64,
    /// `exhaustive`: spacing of the turns from 0 to 360 degrees, radians.
    #[schemars(range(min = 1e-3, max = PI))]
    pub turn_step: f64,
    /// `icp_svd`: a run ends when the sum of the squared distances from nodes to their nearest nodes changes by less
    /// than this, square metres.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tau: f64,
    /// `icp_svd`: number of evenly spaced turns from which runs start. The published method has one, without a turn.
    #[schemars(range(min = 1, max = 1000))]
    pub starts: usize,
    /// `icp_svd`: most iterations of a run.
    #[schemars(range(min = 1, max = 100000))]
    pub max_iterations: usize,
    /// Whether a pose is refined on the ends of the paths that coincide there. `false` leaves it unrefined, as
    /// published.
    pub refine: bool,
    /// Standard deviation of the position of a node along x and along y, metres, for the covariance.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub node_stddev: f64,
    /// Largest number of poses that are reported, each apart from the others.
    #[schemars(range(min = 1, max = 1000))]
    pub max_hypotheses: usize,
    /// Two poses are distinct if they differ by a turn of more than this, radians, or by `apart`.
    #[schemars(range(min = 0.0, max = PI))]
    pub apart_yaw: f64,
    /// Two poses are distinct if they differ by more than this at the centroid of the nodes, metres, or by
    /// `apart_yaw`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart: f64,
    /// Least number of pairs of paths that coincide at an accepted pose; `min_share` and `max_runner_up` must hold as
    /// well.
    pub min_paths: usize,
    /// Least share of the paths of the map with fewer that coincide at an accepted pose, 0 to 1; `min_paths` and
    /// `max_runner_up` must hold as well.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_share: f64,
    /// Largest number of pairs of paths that coincide at the second-best pose, as a share of that at an accepted
    /// pose, 0 to 1; `min_paths` and `min_share` must hold as well.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_runner_up: f64,
    /// Largest number of nodes of a map that is matched: time grows with more than the square of their number. Three
    /// paths for each of them are matched at most.
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

/// Paths that are matched for each node, at most: a map on a floor has less than three, as its paths hardly cross.
pub(super) const PATHS_FOR_EACH_NODE: usize = 3;

impl TopologyMatcherParameters {
    /// Largest number of paths of a map that is matched.
    pub(super) fn max_paths(&self) -> usize {
        PATHS_FOR_EACH_NODE * self.max_nodes
    }
}

impl Parameters for TopologyMatcherParameters {}

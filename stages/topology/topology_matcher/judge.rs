//! Decides whether the best pose of two topological maps is used.

use super::{MatchedPose, Topology, TopologyMatcherParameters};

/// Verdict on the poses of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseJudgement {
    /// Whether the best pose is used.
    pub accepted: bool,
    /// Share of the paths of the map with fewer that coincide with paths of the other at the best pose, 0 to 1.
    pub score: f64,
    /// Reason for the user.
    pub reason: String,
}

/// Judges the best pose by the share of paths that coincide there, and by how many coincide elsewhere. `poses` are
/// those of map b in map a, the best first.
///
/// The published methods take the best pose in any case. Here the best pose must have enough coinciding paths, and
/// clearly more than any other: unrelated and self-similar maps have no clear best one. It is no check against the
/// walls, and it can be wrong.
pub fn judge(
    a: &Topology,
    b: &Topology,
    poses: &[MatchedPose],
    parameters: &TopologyMatcherParameters,
) -> PoseJudgement {
    let count = |map: &Topology| map.long_paths(parameters.tolerance).count();
    let fewer = count(a).min(count(b));
    let Some(best) = poses.first() else {
        let reason = match fewer {
            0 => "a topological map has no path that is longer than twice the tolerance",
            _ => "no paths of the topological maps coincide at any pose\ntry: let one robot drive where the other was",
        };
        return PoseJudgement { accepted: false, score: 0.0, reason: reason.into() };
    };
    let score = (best.similarity as f64 / fewer.max(1) as f64).min(1.0);
    let elsewhere = poses.get(1).map_or(0, |matched_pose| matched_pose.similarity);
    let found =
        format!("{} of {fewer} paths coincide at the best pose, and {elsewhere} at the second-best", best.similarity);
    let missing = if best.similarity < parameters.min_paths {
        Some(format!("missing: {} paths that coincide (min_paths)", parameters.min_paths))
    } else if score < parameters.min_share {
        Some(format!("missing: {:.0} % of the paths (min_share)", 100.0 * parameters.min_share))
    } else if elsewhere as f64 > parameters.max_runner_up * best.similarity as f64 {
        let most = 100.0 * parameters.max_runner_up;
        Some(format!("missing: at most {most:.0} % of as many paths at the second-best pose (max_runner_up)"))
    } else {
        None
    };
    let reason = match &missing {
        Some(missing) => format!("{found}\n{missing}\ntry: let one robot drive where the other was"),
        None => found,
    };
    PoseJudgement { accepted: missing.is_none(), score, reason }
}

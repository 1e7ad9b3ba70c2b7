//! A relative pose of two topological maps.

use super::{Topology, TopologyMatcherParameters, coinciding};
use crate::shared::geometry::{PointPair, Pose2, fit_rigid};
use nalgebra::Matrix3;

/// A relative pose of map b in map a, with the paths that coincide.
#[derive(Clone, Debug, PartialEq)]
pub struct MatchedPose {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw) of `T_a_b`, metres and radians.
    pub covariance: Matrix3<f64>,
    /// Number of pairs of paths that coincide: equation 2.
    pub similarity: usize,
    /// Root mean square of the distances between the ends of paths that coincide, metres.
    pub rms: f64,
}

impl MatchedPose {
    /// The pose `transform_a_b`, refined on the paths that coincide there if the parameters say so. None if no paths
    /// coincide.
    pub fn at(
        a: &Topology,
        b: &Topology,
        transform_a_b: Pose2,
        parameters: &TopologyMatcherParameters,
    ) -> Option<Self> {
        let found = Self::fitted(a, b, &transform_a_b, parameters)?;
        if !parameters.refine {
            return Some(Self { transform_a_b, ..found });
        }
        // At the refined pose more paths may coincide, and some at the border of the tolerance no longer do.
        let again = Self::fitted(a, b, &found.transform_a_b, parameters);
        let better = again.filter(|again| again.similarity >= found.similarity);
        Some(better.unwrap_or(Self { transform_a_b, ..found }))
    }

    /// The pose that aligns the ends of the paths that coincide at `transform_a_b` (least squares).
    fn fitted(
        a: &Topology,
        b: &Topology,
        transform_a_b: &Pose2,
        parameters: &TopologyMatcherParameters,
    ) -> Option<Self> {
        let pairs = coinciding(a, b, transform_a_b, parameters.tolerance);
        let mut ends: Vec<[usize; 2]> =
            pairs.iter().flat_map(|pair| [[pair.a[0], pair.b[0]], [pair.a[1], pair.b[1]]]).collect();
        // A node where many paths meet is one node.
        ends.sort_unstable();
        ends.dedup();
        let variance = 2.0 * parameters.node_stddev * parameters.node_stddev;
        let points =
            ends.iter().map(|[one, other]| PointPair { a: a.nodes[*one], b: b.nodes[*other], weight: 1.0 / variance });
        let fit = fit_rigid(&points.collect::<Vec<_>>())?;
        // If the nodes are farther apart than their deviation allows, the covariance is increased.
        let excess = (fit.rms * fit.rms / (2.0 * variance)).max(1.0);
        Some(Self {
            transform_a_b: fit.transform_a_b,
            covariance: fit.covariance * excess,
            similarity: pairs.len(),
            rms: fit.rms,
        })
    }

    /// Whether another pose is nearly the same.
    fn is_near(&self, other: &Self, b: &Topology, parameters: &TopologyMatcherParameters) -> bool {
        let (one, another) = (self.transform_a_b, other.transform_a_b);
        let apart = (one * b.centre() - another * b.centre()).norm();
        one.rotation.angle_to(&another.rotation).abs() <= parameters.apart_yaw && apart <= parameters.apart
    }
}

/// The best poses, by the number of paths that coincide and then by their accuracy, each apart from those before it:
/// at most `count`. Of equals the first in the list comes first.
pub fn distinct(
    poses: Vec<MatchedPose>,
    count: usize,
    b: &Topology,
    parameters: &TopologyMatcherParameters,
) -> Vec<MatchedPose> {
    let mut sorted = poses;
    sorted.sort_by(|one, other| other.similarity.cmp(&one.similarity).then(one.rms.total_cmp(&other.rms)));
    let mut kept: Vec<MatchedPose> = Vec::new();
    for matched_pose in sorted {
        if kept.len() == count {
            break;
        }
        if !kept.iter().any(|better| better.is_near(&matched_pose, b, parameters)) {
            kept.push(matched_pose);
        }
    }
    kept
}

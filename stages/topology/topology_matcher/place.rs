//! Where two topological maps may lie to each other.

use super::{Topology, TopologyMatcherParameters, coinciding};
use crate::shared::geometry::{PointPair, Pose2, fit_rigid};
use nalgebra::Matrix3;

/// A place of map b on map a.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw) of `T_a_b`, metres and radians.
    pub covariance: Matrix3<f64>,
    /// How many pairs of paths coincide: equation 2.
    pub similarity: usize,
    /// Root mean square of the distances between the ends of paths that coincide, metres.
    pub rms: f64,
}

impl Place {
    /// The place at `transform_a_b`, made exact on the paths that coincide there if that is asked for. None if no paths
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
        // At the exact place more paths may coincide, and some that lay at the border of the tolerance no longer.
        let again = Self::fitted(a, b, &found.transform_a_b, parameters);
        let better = again.filter(|again| again.similarity >= found.similarity);
        Some(better.unwrap_or(Self { transform_a_b, ..found }))
    }

    /// The place that lays the ends of the paths that coincide at `transform_a_b` on each other (least squares).
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
        // What the nodes are farther apart than their deviation allows is to be seen in the covariance.
        let excess = (fit.rms * fit.rms / (2.0 * variance)).max(1.0);
        Some(Self {
            transform_a_b: fit.transform_a_b,
            covariance: fit.covariance * excess,
            similarity: pairs.len(),
            rms: fit.rms,
        })
    }

    /// Whether another place is the same but for little.
    fn is_near(&self, other: &Self, b: &Topology, parameters: &TopologyMatcherParameters) -> bool {
        let (one, another) = (self.transform_a_b, other.transform_a_b);
        let apart = (one * b.centre() - another * b.centre()).norm();
        one.rotation.angle_to(&another.rotation).abs() <= parameters.apart_yaw && apart <= parameters.apart
    }
}

/// The best of the places, by the number of paths that coincide and then by how exactly, each away from those before it: at
/// most `count`. Of equals the first in the list comes first.
pub fn distinct(places: Vec<Place>, count: usize, b: &Topology, parameters: &TopologyMatcherParameters) -> Vec<Place> {
    let mut sorted = places;
    sorted.sort_by(|one, other| other.similarity.cmp(&one.similarity).then(one.rms.total_cmp(&other.rms)));
    let mut kept: Vec<Place> = Vec::new();
    for place in sorted {
        if kept.len() == count {
            break;
        }
        if !kept.iter().any(|better| better.is_near(&place, b, parameters)) {
            kept.push(place);
        }
    }
    kept
}

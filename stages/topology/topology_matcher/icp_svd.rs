//! Iterative closest points on nodes.

use super::matched_pose::distinct;
use super::{MatchedPose, Topology, TopologyMatcherParameters};
use crate::shared::geometry::{Point2, PointPair, Pose2, fit_rigid};
use nalgebra::UnitComplex;
use std::f64::consts::TAU;

/// A run from one start.
#[derive(Clone, Debug, PartialEq)]
pub struct IcpSvd {
    /// `T_a_b` at the end of the run.
    pub transform_a_b: Pose2,
    /// The sum of the squared distances from the nodes of b to the nearest nodes of a after each iteration, square
    /// metres: equation 4 over nearest nodes.
    pub errors: Vec<f64>,
    /// Whether it ended because the error no longer changed, and not by the limit of iterations.
    pub converged: bool,
}

/// Runs from evenly spaced turns, in their order, each with the centre of b on the centre of a; and the best distinct
/// poses at which they end.
pub fn icp_svd(a: &Topology, b: &Topology, parameters: &TopologyMatcherParameters) -> (Vec<IcpSvd>, Vec<MatchedPose>) {
    let start = |number: usize| {
        let rotation = UnitComplex::new(TAU * number as f64 / parameters.starts as f64);
        let translation = a.centre().coords - rotation * b.centre().coords;
        Pose2::from_parts(translation.into(), rotation)
    };
    let runs = (0..parameters.starts).map(|number| icp_svd_from(a, b, start(number), parameters));
    let runs: Vec<IcpSvd> = runs.collect();
    let poses = runs.iter().filter_map(|run| MatchedPose::at(a, b, run.transform_a_b, parameters)).collect();
    (runs, distinct(poses, parameters.max_hypotheses, b, parameters))
}

/// One run: each node of b is paired with the nearest node of a, and the pose of b minimizes the squared distances of
/// the pairs, until their sum changes by less than `tau` from one iteration to the next. It converges to the optimum
/// nearest to `start`; the published start (step 1) aligns the means of b and a without a turn.
///
/// The best rotation of equation 6 comes from a singular value decomposition; in the plane that is one angle, and it
/// is never a reflection ([`fit_rigid`]).
pub fn icp_svd_from(a: &Topology, b: &Topology, start: Pose2, parameters: &TopologyMatcherParameters) -> IcpSvd {
    let mut run = IcpSvd { transform_a_b: start, errors: Vec::new(), converged: false };
    while run.errors.len() < parameters.max_iterations && !run.converged {
        let pairs: Vec<PointPair> = b.nodes.iter().filter_map(|node| nearest(a, node, &run.transform_a_b)).collect();
        let Some(fit) = fit_rigid(&pairs) else { break };
        run.transform_a_b = fit.transform_a_b;
        // The error of the new pose is that to the nodes that are nearest from there.
        let placed = b.nodes.iter().filter_map(|node| nearest(a, node, &run.transform_a_b));
        let error: f64 = placed.map(|pair| (pair.a - run.transform_a_b * pair.b).norm_squared()).sum();
        run.converged = run.errors.last().is_some_and(|before| (before - error).abs() < parameters.tau);
        run.errors.push(error);
    }
    run
}

/// A node of b with the node of a that is nearest to it; the first of equals. None if a has no nodes.
fn nearest(a: &Topology, node: &Point2, transform_a_b: &Pose2) -> Option<PointPair> {
    let placed = transform_a_b * node;
    let distance = |node: &Point2| (node - placed).norm_squared();
    let nearest = a.nodes.iter().min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
    Some(PointPair { a: *nearest, b: *node, weight: 1.0 })
}

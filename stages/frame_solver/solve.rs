//! From alignments of pairs to one pose for every robot.

use super::consistency::{Verdict, judge};
use super::graph::{Cycle, Edge, Forest};
use super::reasons;
use super::{FrameSolverParameters, UncertainPose, optimize, uncertain::error_vector};
use crate::geometry::row_by_row;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;
use std::collections::{BTreeMap, BTreeSet};

/// A length (metres) or variance beyond which a value of an alignment is taken for garbage.
const ABSURD: f64 = 1e7;

/// Two robots, the first by name first.
pub type Pair = (String, String);

/// Where every robot's map lies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solution {
    /// `T_reference_robot` for every robot that is tied to the reference, itself among them. Its covariance is relative
    /// to the reference.
    pub frames: BTreeMap<String, UncertainPose>,
    /// The robots that are not, with the reason.
    pub unmerged: BTreeMap<String, String>,
    /// The alignments that their stage accepted and that were left out here, with the reason.
    pub left_out: BTreeMap<Pair, String>,
}

/// The latest alignment of each pair, `a` before `b` by name.
pub type Alignments = BTreeMap<Pair, Alignment>;

/// Brings an alignment into the form in which `a` is the first of the pair by name. `None` if it is no pair.
pub fn by_name(mut alignment: Alignment) -> Option<(Pair, Alignment)> {
    if alignment.a == alignment.b || alignment.a.is_empty() || alignment.b.is_empty() {
        return None;
    }
    if alignment.a > alignment.b {
        let transform_a_b = UncertainPose {
            pose: alignment.transform_a_b(),
            covariance: Matrix3::from_row_slice(&alignment.covariance),
        };
        let transform_b_a = transform_a_b.inverse();
        std::mem::swap(&mut alignment.a, &mut alignment.b);
        alignment.set_transform_a_b(&transform_b_a.pose);
        alignment.covariance = row_by_row(&transform_b_a.covariance);
    }
    Some(((alignment.a.clone(), alignment.b.clone()), alignment))
}

/// Solves for the frames of all `robots` in the frame of `reference`, which must be one of them.
///
/// Alignments that cannot be right, given the others, are left out; a robot that is tied to the reference only through
/// alignments of which it cannot be told whether they are right is not merged. What remains is solved by weighted
/// least squares, from the poses along the paths of least variance.
pub fn solve(
    robots: &BTreeSet<String>,
    alignments: &Alignments,
    reference: &str,
    parameters: &FrameSolverParameters,
) -> Solution {
    let names: Vec<&str> = robots.iter().map(String::as_str).collect();
    let index_of = |name: &str| names.binary_search(&name).ok();
    let Some(root) = index_of(reference) else { return Solution::default() };

    let mut left_out = BTreeMap::new();
    let mut edges = Vec::new();
    let mut pairs = Vec::new();
    for (pair, alignment) in alignments.iter().filter(|(_, alignment)| alignment.accepted) {
        let (Some(a), Some(b)) = (index_of(&pair.0), index_of(&pair.1)) else { continue };
        match usable(alignment, parameters) {
            Ok(transform_a_b) => {
                edges.push(Edge { a, b, transform_a_b });
                pairs.push(pair);
            }
            Err(reason) => {
                left_out.insert(pair.clone(), format!("left out: {reason}"));
            }
        }
    }

    let verdicts = judge(names.len(), &edges, parameters.gate);
    let mut disputed = BTreeMap::new();
    for ((verdict, edge), pair) in verdicts.iter().zip(&edges).zip(&pairs) {
        let reason = match verdict {
            Verdict::Right => continue,
            Verdict::Wrong(cycle) => reasons::contradicts(&describe(cycle, &pairs)),
            Verdict::Disputed(cycle) => {
                let reason = reasons::disputed(&describe(cycle, &pairs));
                for robot in [edge.a, edge.b] {
                    disputed.entry(names[robot].to_owned()).or_insert_with(|| reason.clone());
                }
                reason
            }
        };
        left_out.insert((*pair).clone(), format!("left out: {reason}"));
    }

    let right: Vec<Edge> =
        verdicts.iter().zip(&edges).filter(|(verdict, _)| matches!(verdict, Verdict::Right)).map(|(_, e)| *e).collect();
    let along_tree = Forest::grow(names.len(), &right, root, |_| true).poses(&right, root);
    let poses = optimize::optimize(&along_tree, &right, root).unwrap_or(along_tree);
    let frames: BTreeMap<String, UncertainPose> =
        names.iter().zip(poses).filter_map(|(name, pose)| Some(((*name).to_owned(), pose?))).collect();
    let unmerged = reasons::unmerged(robots, &frames, alignments, &left_out, &disputed);
    Solution { frames, unmerged, left_out }
}

/// The transform of an alignment with the floors added, or why it cannot be used.
fn usable(alignment: &Alignment, parameters: &FrameSolverParameters) -> Result<UncertainPose, String> {
    if alignment.provisional {
        return Err(format!(
            "it is provisional, and no stage between has confirmed it by the walls of the maps, as icp_refiner does ({})",
            alignment.reason
        ));
    }
    let values = [alignment.x, alignment.y, alignment.yaw].into_iter().chain(alignment.covariance);
    if !values.into_iter().all(|value| value.abs() < ABSURD) {
        return Err("its transform or covariance holds a value that is no finite number or absurdly large".into());
    }
    let covariance = Matrix3::from_row_slice(&alignment.covariance);
    let symmetric = (covariance + covariance.transpose()) / 2.0;
    let transform_a_b = UncertainPose { pose: alignment.transform_a_b(), covariance: symmetric }
        .with_floor(parameters.position_floor, parameters.yaw_floor);
    match transform_a_b.covariance.cholesky() {
        Some(_) => Ok(transform_a_b),
        None => Err("its covariance is none: it has a negative variance in some direction".into()),
    }
}

/// What a reader needs to know of a cycle that does not close.
pub(super) struct OpenCycle {
    /// The pairs along it.
    pub(super) pairs: Vec<Pair>,
    /// By how much it does not close, metres.
    pub(super) metres: f64,
    /// By how much it does not close, radians.
    pub(super) radians: f64,
    /// The same in standard deviations.
    pub(super) deviations: f64,
}

fn describe(cycle: &Cycle, pairs: &[&Pair]) -> OpenCycle {
    let error = error_vector(&cycle.remainder.pose);
    let mut on_cycle: Vec<Pair> = cycle.edges.iter().map(|&index| pairs[index].clone()).collect();
    on_cycle.sort();
    OpenCycle {
        pairs: on_cycle,
        metres: error.xy().norm(),
        radians: error.z.abs(),
        deviations: cycle.remainder.distance_from_identity(),
    }
}

//! From alignments of pairs to one pose for every robot.

use super::consistency::{EdgeVerdict, judge};
use super::graph::{Cycle, Edge, Forest};
use super::reasons;
use super::solution::{Alignments, OpenCycle, PlacedGroup, Solution};
use super::{FrameSolverParameters, UncertainPose, optimize, uncertain::error_vector};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;
use std::collections::{BTreeMap, BTreeSet};

/// A length beyond which a translation is invalid, metres. Frames with the origin of UTM are that far away.
const ABSURD: f64 = 1e7;
/// The same for a value of a covariance: there, a turn of the map moves the origin of its frame by kilometres.
const ABSURD_VARIANCE: f64 = ABSURD * ABSURD;

/// Solves for the frames of all `robots` in the frame of `reference`, which must be one of them.
///
/// Alignments that cannot be right, given the others, are left out; a robot that is connected with the reference only
/// through disputed alignments is not merged. What remains is solved by weighted least squares, from the poses along
/// the paths of least variance; so is each group of robots that are connected with each other only.
///
/// `before` is the solution of the last call, if there was one: groups keep their references, and alignments that
/// were found to agree are not checked again.
pub fn solve(
    robots: &BTreeSet<String>,
    alignments: &Alignments,
    reference: &str,
    parameters: &FrameSolverParameters,
    before: &Solution,
) -> Solution {
    let names: Vec<&str> = robots.iter().map(String::as_str).collect();
    let index_of = |name: &str| names.binary_search(&name).ok();
    let Some(root) = index_of(reference) else { return Solution::default() };

    let mut left_out = BTreeMap::new();
    let mut edges = Vec::new();
    let mut pairs = Vec::new();
    for (pair, alignment) in alignments.iter().filter(|(_, alignment)| alignment.accepted) {
        let (Some(a), Some(b)) = (index_of(&pair.a), index_of(&pair.b)) else { continue };
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

    let known: Vec<bool> =
        pairs.iter().zip(&edges).map(|(pair, edge)| before.used.get(*pair) == Some(&edge.transform_a_b)).collect();
    let verdicts = judge(names.len(), &edges, &known, parameters.gate);
    let mut disputed = BTreeMap::new();
    for ((verdict, edge), pair) in verdicts.iter().zip(&edges).zip(&pairs) {
        let reason = match verdict {
            EdgeVerdict::Right => continue,
            EdgeVerdict::Wrong(cycle) => reasons::contradicts(&describe(cycle, &pairs)),
            EdgeVerdict::Disputed(cycle) => {
                let reason = reasons::disputed(&describe(cycle, &pairs));
                for robot in [edge.a, edge.b] {
                    disputed.entry(names[robot].to_owned()).or_insert_with(|| reason.clone());
                }
                reason
            }
        };
        left_out.insert((*pair).clone(), format!("left out: {reason}"));
    }

    let is_right = |verdict: &EdgeVerdict| matches!(verdict, EdgeVerdict::Right);
    let right: Vec<Edge> =
        verdicts.iter().zip(&edges).filter(|(verdict, _)| is_right(verdict)).map(|(_, edge)| *edge).collect();
    let used = verdicts.iter().zip(&edges).zip(&pairs).filter(|((verdict, _), _)| is_right(verdict));
    let used = used.map(|((_, edge), pair)| ((*pair).clone(), edge.transform_a_b)).collect();

    let frames = place(&names, &right, root);
    let references = before.groups.iter().filter_map(|group| index_of(&group.reference));
    let groups = other_groups(&names, &right, &frames, references);
    let mut solution = Solution { frames, groups, disputed, left_out, used, ..Solution::default() };
    solution.unmerged = reasons::unmerged(robots, &solution, alignments);
    solution
}

/// The groups of robots without a frame that edges connect with each other. Their references are `references`, if they
/// are among them, and else the first.
fn other_groups(
    names: &[&str],
    edges: &[Edge],
    placed: &BTreeMap<String, UncertainPose>,
    references: impl Iterator<Item = usize>,
) -> Vec<PlacedGroup> {
    let mut tied: BTreeSet<usize> = edges.iter().flat_map(|edge| [edge.a, edge.b]).collect();
    tied.retain(|&robot| !placed.contains_key(names[robot]));
    let mut groups = Vec::new();
    for root in references.chain(tied.clone()) {
        if tied.contains(&root) {
            let frames = place(names, edges, root);
            tied.retain(|&robot| !frames.contains_key(names[robot]));
            groups.push(PlacedGroup { reference: names[root].to_owned(), frames });
        }
    }
    groups.sort_by(|one, other| one.reference.cmp(&other.reference));
    groups
}

/// `T_root_robot` for all robots that the edges connect with the root.
fn place(names: &[&str], edges: &[Edge], root: usize) -> BTreeMap<String, UncertainPose> {
    let along_tree = Forest::grow(names.len(), edges, root, |_| true).poses(edges, root);
    let poses = optimize::optimize(&along_tree, edges, root).unwrap_or(along_tree);
    names.iter().zip(poses).filter_map(|(name, pose)| Some(((*name).to_owned(), pose?))).collect()
}

/// The transform of an alignment with the floors added, or why it cannot be used.
fn usable(alignment: &Alignment, parameters: &FrameSolverParameters) -> Result<UncertainPose, String> {
    if alignment.provisional {
        return Err(format!(
            "it is provisional, and no stage such as merge_verifier has confirmed it by the maps ({})",
            alignment.reason
        ));
    }
    let are_valid = [alignment.x, alignment.y, alignment.yaw].iter().all(|value| value.abs() < ABSURD)
        && alignment.covariance.iter().all(|value| value.abs() < ABSURD_VARIANCE);
    if !are_valid {
        return Err("a value of its transform or covariance is not finite, or absurdly large".into());
    }
    let covariance = Matrix3::from_row_slice(&alignment.covariance);
    let symmetric = (covariance + covariance.transpose()) / 2.0;
    let transform_a_b = UncertainPose { pose: alignment.transform_a_b(), covariance: symmetric }
        .with_floor(parameters.position_floor, parameters.yaw_floor);
    match transform_a_b.covariance.cholesky() {
        Some(_) => Ok(transform_a_b),
        None => Err("its covariance is invalid: it has a negative variance in some direction".into()),
    }
}

fn describe(cycle: &Cycle, pairs: &[&RobotPair]) -> OpenCycle {
    let error = error_vector(&cycle.remainder.pose);
    let mut on_cycle: Vec<RobotPair> = cycle.edges.iter().map(|&index| pairs[index].clone()).collect();
    on_cycle.sort();
    OpenCycle {
        pairs: on_cycle,
        metres: error.xy().norm(),
        radians: error.z.abs(),
        deviations: cycle.remainder.distance_from_identity(),
    }
}

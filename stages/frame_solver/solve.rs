//! From alignments of pairs to one pose for every robot.

use super::consistency::{Verdict, judge};
use super::graph::{Cycle, Edge, Forest};
use super::reasons;
use super::{FrameSolverParameters, UncertainPose, optimize, uncertain::error_vector};
use crate::geometry::{Pose2, row_by_row};
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
    /// Those of them that are tied to each other, by the name of the group's reference.
    pub groups: Vec<Group>,
    /// The alignments that their stage accepted and that were left out here, with the reason.
    pub left_out: BTreeMap<Pair, String>,
    /// The others, `T_a_b` with the floors added to the covariance: what the frames were solved from.
    pub used: BTreeMap<Pair, UncertainPose>,
}

/// Robots that are tied to each other, but not to the reference.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group {
    /// The robot in whose map frame the others are placed.
    pub reference: String,
    /// `T_reference_robot` for every robot of the group, two at least, the reference among them. Its covariance is
    /// relative to the group's reference.
    pub frames: BTreeMap<String, UncertainPose>,
}

impl Solution {
    /// The sum of the squared deviations (Mahalanobis distances) of all alignments that are used, if the robots' map
    /// frames were at the poses given: those tied to each other in one frame.
    pub fn squared_deviations(&self, poses: &BTreeMap<&str, Pose2>) -> f64 {
        let deviation = |((a, b), transform_a_b): (&Pair, &UncertainPose)| {
            let (pose_a, pose_b) = (poses.get(a.as_str())?, poses.get(b.as_str())?);
            Some(optimize::squared_deviation(&Edge { a: 0, b: 1, transform_a_b: *transform_a_b }, pose_a, pose_b))
        };
        self.used.iter().filter_map(deviation).sum()
    }

    /// The alignments that are used and that no other one can check: those in no cycle.
    pub fn unchecked(&self) -> BTreeSet<&Pair> {
        let robots: BTreeSet<&String> = self.used.keys().flat_map(|(a, b)| [a, b]).collect();
        let places: BTreeMap<&String, usize> =
            robots.iter().enumerate().map(|(place, robot)| (*robot, place)).collect();
        let edges: Vec<Edge> = self
            .used
            .iter()
            .map(|((a, b), transform_a_b)| Edge { a: places[a], b: places[b], transform_a_b: *transform_a_b })
            .collect();
        let forest = Forest::grow(places.len(), &edges, 0, |_| true);
        let closing = (0..edges.len()).filter(|&index| !forest.contains(index, &edges[index]));
        let checked: BTreeSet<usize> =
            closing.filter_map(|index| forest.cycle(&edges, index)).flat_map(|cycle| cycle.edges).collect();
        self.used.keys().enumerate().filter(|(index, _)| !checked.contains(index)).map(|(_, pair)| pair).collect()
    }
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
/// least squares, from the poses along the paths of least variance; so is each group of robots that are tied to each
/// other only.
///
/// `before` is the solution of the last call, if there was one: groups keep their references, and what has been found
/// to agree is not looked at again.
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

    let known: Vec<bool> =
        pairs.iter().zip(&edges).map(|(pair, edge)| before.used.get(*pair) == Some(&edge.transform_a_b)).collect();
    let verdicts = judge(names.len(), &edges, &known, parameters.gate);
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

    let is_right = |verdict: &Verdict| matches!(verdict, Verdict::Right);
    let right: Vec<Edge> =
        verdicts.iter().zip(&edges).filter(|(verdict, _)| is_right(verdict)).map(|(_, edge)| *edge).collect();
    let used = verdicts.iter().zip(&edges).zip(&pairs).filter(|((verdict, _), _)| is_right(verdict));
    let used = used.map(|((_, edge), pair)| ((*pair).clone(), edge.transform_a_b)).collect();

    let frames = place(&names, &right, root);
    let mut tied: BTreeSet<usize> = right.iter().flat_map(|edge| [edge.a, edge.b]).collect();
    let mut groups = Vec::new();
    let references = before.groups.iter().filter_map(|group| index_of(&group.reference));
    tied.retain(|&robot| !frames.contains_key(names[robot]));
    for root in references.chain(tied.clone()) {
        if tied.contains(&root) {
            let frames = place(&names, &right, root);
            tied.retain(|&robot| !frames.contains_key(names[robot]));
            groups.push(Group { reference: names[root].to_owned(), frames });
        }
    }
    groups.sort_by(|one, other| one.reference.cmp(&other.reference));
    let mut solution = Solution { frames, groups, left_out, used, ..Solution::default() };
    solution.unmerged = reasons::unmerged(robots, &solution, alignments, &disputed);
    solution
}

/// `T_root_robot` for all robots that the edges tie to the root.
fn place(names: &[&str], edges: &[Edge], root: usize) -> BTreeMap<String, UncertainPose> {
    let along_tree = Forest::grow(names.len(), edges, root, |_| true).poses(edges, root);
    let poses = optimize::optimize(&along_tree, edges, root).unwrap_or(along_tree);
    names.iter().zip(poses).filter_map(|(name, pose)| Some(((*name).to_owned(), pose?))).collect()
}

/// The transform of an alignment with the floors added, or why it cannot be used.
fn usable(alignment: &Alignment, parameters: &FrameSolverParameters) -> Result<UncertainPose, String> {
    if alignment.provisional {
        return Err(format!(
            "it is provisional, and no stage between has confirmed it by the walls of the maps, as merge_verifier does ({})",
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

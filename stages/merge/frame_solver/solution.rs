//! The data of a problem and of its solution.

use super::graph::{Edge, Forest};
use super::{UncertainPose, optimize};
use crate::shared::geometry::{Pose2, row_by_row};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;
use std::collections::{BTreeMap, BTreeSet};

/// Poses of all robots' maps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solution {
    /// `T_reference_robot` for every robot that is connected with the reference, including itself. The covariance is
    /// relative to the reference.
    pub frames: BTreeMap<String, UncertainPose>,
    /// The robots that are not, with the reason.
    pub unmerged: BTreeMap<String, String>,
    /// Those of them that are connected with each other, by the name of the group's reference.
    pub groups: Vec<PlacedGroup>,
    /// Robots whose alignments contradict each other, with the reason.
    pub disputed: BTreeMap<String, String>,
    /// Alignments that their stage accepted and that were left out here, with the reason.
    pub left_out: BTreeMap<RobotPair, String>,
    /// The others, `T_a_b` with the floors added to the covariance, from which the frames were solved.
    pub used: BTreeMap<RobotPair, UncertainPose>,
}

/// Robots that are connected with each other, but not with the reference.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacedGroup {
    /// The robot in whose map frame the others are placed.
    pub reference: String,
    /// `T_reference_robot` for every robot of the group, two at least, including the reference. The covariance is
    /// relative to the group's reference.
    pub frames: BTreeMap<String, UncertainPose>,
}

impl Solution {
    /// Sum of the squared Mahalanobis distances of all alignments that are used, for given poses of the robots' map
    /// frames, with those connected with each other in one frame.
    pub fn squared_deviations(&self, poses: &BTreeMap<&str, Pose2>) -> f64 {
        let deviation = |(pair, transform_a_b): (&RobotPair, &UncertainPose)| {
            let [pose_a, pose_b] = [poses.get(pair.a.as_str())?, poses.get(pair.b.as_str())?];
            Some(optimize::squared_deviation(&Edge { a: 0, b: 1, transform_a_b: *transform_a_b }, pose_a, pose_b))
        };
        self.used.iter().filter_map(deviation).sum()
    }

    /// The used alignments that no other one can check: those in no cycle.
    pub fn unchecked(&self) -> BTreeSet<&RobotPair> {
        let robots: BTreeSet<&String> = self.used.keys().flat_map(|pair| [&pair.a, &pair.b]).collect();
        let places: BTreeMap<&String, usize> =
            robots.iter().enumerate().map(|(place, robot)| (*robot, place)).collect();
        let edges: Vec<Edge> = self
            .used
            .iter()
            .map(|(pair, transform_a_b)| Edge { a: places[&pair.a], b: places[&pair.b], transform_a_b: *transform_a_b })
            .collect();
        let forest = Forest::grow(places.len(), &edges, 0, |_| true);
        let closing = (0..edges.len()).filter(|&index| !forest.contains(index, &edges[index]));
        let checked: BTreeSet<usize> =
            closing.filter_map(|index| forest.cycle(&edges, index)).flat_map(|cycle| cycle.edges).collect();
        self.used.keys().enumerate().filter(|(index, _)| !checked.contains(index)).map(|(_, pair)| pair).collect()
    }
}

/// The latest alignment of each pair, of which robot a is the first by name.
pub type Alignments = BTreeMap<RobotPair, Alignment>;

/// Inverts an alignment, if necessary, so that `a` is the first of the pair by name. `None` if it is no pair.
pub fn by_name(mut alignment: Alignment) -> Option<(RobotPair, Alignment)> {
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
    Some((RobotPair::of(&alignment), alignment))
}

/// Description of a cycle that does not close, for a reader.
pub(super) struct OpenCycle {
    /// The pairs along it.
    pub(super) pairs: Vec<RobotPair>,
    /// Translation of the product of the cycle, metres.
    pub(super) metres: f64,
    /// Rotation of the product of the cycle, radians.
    pub(super) radians: f64,
    /// Mahalanobis distance of the product from the identity.
    pub(super) deviations: f64,
}

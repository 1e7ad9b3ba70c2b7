//! The trajectories of several robots in one pose graph.
//!
//! Where it is known how the maps of robots lie to each other, the submaps of one are searched in those of the others as
//! they are in the robot's own, and each scan is registered on what any robot saw at its place. What one robot has
//! closed by a loop then straightens what another has not (multi-robot pose graphs: Kim et al. 2010, "Multiple relative
//! pose graphs for robust cooperative mapping"; as in Cartographer, all trajectories are nodes of one graph).

use super::contradictions::{Contradictions, find_contradictions};
use super::loop_closure::{Drive, Revisit, find_closures, middle};
use super::pose_graph::{Constraint, LandmarkSighting, PoseGraph};
use super::revisits::refine;
use super::scan_points::ScanPoint;
use super::trajectory::{RECENT_SCANS, Trajectory};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Standard deviations of the relative pose of two submaps by the given frames, metres and radians: maps that are bent lie
/// to each other as a rigid pose only to some decimetres.
const FRAME_DEVIATIONS: [f64; 2] = [0.3, 0.03];

/// A trajectory, and the pose of its frame in one that all robots have in common.
#[derive(Clone, Copy, Debug)]
pub struct FramedTrajectory<'a> {
    /// The scans with their poses.
    pub trajectory: &'a Trajectory,
    /// `T_common_own`.
    pub frame: Pose2,
}

/// The scans of several robots.
#[derive(Default)]
struct JointTrajectories<'a> {
    graph: PoseGraph,
    scans: Vec<&'a [ScanPoint]>,
    submaps: Vec<Range<usize>>,
    drives: Vec<Drive>,
    /// Numbers of the tags that any robot saw.
    landmarks: BTreeMap<&'a str, usize>,
}

/// Finds the most likely poses of the scans of all robots together, in the common frame. Each trajectory must have walls
/// in common with one before it: where none of its submaps lies on theirs, it has no poses. None has if no two do.
pub fn joint_poses(robots: &[FramedTrajectory<'_>]) -> Vec<Option<Vec<Pose2>>> {
    let mut joint = JointTrajectories::default();
    let drives: Vec<Option<Range<usize>>> = robots.iter().map(|robot| joint.add(robot)).collect();
    if joint.drives.len() < 2 {
        return vec![None; robots.len()];
    }
    refine(&mut joint.graph, &joint.scans, &joint.submaps, &joint.drives, RECENT_SCANS);
    drives.into_iter().map(|drive| Some(joint.graph.poses[drive?].to_vec())).collect()
}

/// Compares each scan with the walls that other robots saw, and with those that its own robot saw at other times. For
/// each robot the poses of the scans in the common frame.
pub fn joint_contradictions(robots: &[(&Trajectory, &[Pose2])]) -> Contradictions {
    let placed = robots.iter().enumerate();
    let placed = placed.flat_map(|(drive, (trajectory, poses))| trajectory.placed_scans(poses, drive));
    find_contradictions(&placed.collect::<Vec<_>>(), RECENT_SCANS)
}

impl<'a> JointTrajectories<'a> {
    /// Adds the scans of a robot, if they lie on those of the robots before. Returns their range.
    fn add(&mut self, robot: &FramedTrajectory<'a>) -> Option<Range<usize>> {
        let FramedTrajectory { trajectory, frame } = robot;
        let (first, first_submap) = (self.scans.len(), self.submaps.len());
        let known = self.graph.constraints.len();
        let moved = |range: &Range<usize>| first + range.start..first + range.end;
        self.graph.poses.extend(trajectory.poses().iter().map(|pose| frame * pose));
        self.graph.constraints.extend(trajectory.constraints().iter().map(|own| Constraint {
            from: first + own.from,
            to: first + own.to,
            ..*own
        }));
        self.scans.extend(trajectory.scans());
        self.submaps.extend(trajectory.submaps().iter().map(moved));
        let drive = first..self.scans.len();
        self.drives.push(Drive { scans: drive.clone(), is_recorded: trajectory.is_recorded() });
        if first == 0 {
            self.add_sightings(trajectory, first);
            return Some(drive);
        }
        let closures = self.closures_with_others(first_submap);
        if closures.is_empty() {
            self.graph.poses.truncate(first);
            self.graph.constraints.truncate(known);
            self.scans.truncate(first);
            self.submaps.truncate(first_submap);
            self.drives.pop();
            return None;
        }
        self.graph.constraints.extend(closures);
        self.add_sightings(trajectory, first);
        self.graph.optimize();
        Some(drive)
    }

    /// Adds the tags that a robot saw, whose scans are those from the given one on.
    fn add_sightings(&mut self, trajectory: &'a Trajectory, first: usize) {
        let mut numbers = vec![0; trajectory.tags().len()];
        for (tag, landmark) in trajectory.tags() {
            let next = self.landmarks.len();
            numbers[landmark] = *self.landmarks.entry(tag).or_insert(next);
        }
        let sightings = trajectory.sightings().iter();
        self.graph.sightings.extend(sightings.map(|own| LandmarkSighting {
            from: first + own.from,
            landmark: numbers[own.landmark],
            ..*own
        }));
    }

    /// Loop closures of the last robot, whose submaps are those from the given one on, with the robots before it.
    fn closures_with_others(&self, first_submap: usize) -> Vec<Constraint> {
        let (others, own) = self.submaps.split_at(first_submap);
        let [place, yaw] = FRAME_DEVIATIONS.map(|deviation| deviation.powi(2));
        let covariance = Matrix3::from_diagonal(&Vector3::new(place, place, yaw));
        let of_submap = |submap: &Range<usize>| {
            let submaps: Vec<Range<usize>> = others.iter().chain([submap]).cloned().collect();
            let recent = own[0].start;
            let revisit =
                Revisit { graph: &self.graph, scans: &self.scans, submaps: &submaps, drives: &self.drives, recent };
            let pose = self.graph.poses[middle(submap)];
            find_closures(&revisit, &pose, &revisit.candidates(|_| covariance))
        };
        own.par_iter().flat_map_iter(of_submap).collect()
    }
}

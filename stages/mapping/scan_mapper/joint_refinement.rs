//! The scans of several robots in one pose graph, where their maps show how they lie to each other.

use super::ScanMapperParameters;
use super::robot::Robot;
use super::slam_map::SlamMap;
use crate::mapping::map_cleaner::{MapCleanerParameters, clean};
use crate::mapping::slam::{FramedTrajectory, joint_contradictions, joint_poses};
use crate::registration::judgement::UserKnowledge;
use crate::registration::{PreparedPair, RegistrationParameters, register};
use crate::shared::geometry::{Grid, Point2, Pose2};
use crate::shared::scan_grid::SnapshotMap;
use std::collections::BTreeMap;

/// A robot with the map that was drawn of its scans, without what is no wall.
struct MappedRobot<'a> {
    slam: &'a mut SlamMap,
    map: SnapshotMap,
}

/// A robot of a group, and the pose of its map frame in that of the first.
struct Member {
    robot: usize,
    frame: Pose2,
}

/// Refines the trajectories of robots together whose maps are merged without doubt, each in its own frame as before.
/// Trajectories of which the scans contradict each other at the common poses stay as they are. Returns how many robots
/// are refined with others.
pub(super) fn refine_together(robots: &mut BTreeMap<String, Robot>, parameters: &ScanMapperParameters) -> usize {
    let mut mapped: Vec<MappedRobot<'_>> = robots.values_mut().filter_map(MappedRobot::of).collect();
    let groups = groups(&mapped);
    groups.iter().map(|group| refine_group(group, &mut mapped, parameters)).sum()
}

impl<'a> MappedRobot<'a> {
    /// A robot whose map is built by SLAM, and is right as far as its own scans show.
    fn of(robot: &'a mut Robot) -> Option<Self> {
        robot.test_map(true);
        if robot.bad_scans().is_some() || robot.is_mirrored() {
            return None;
        }
        let mut map = robot.map().0?;
        let drawn = map.cells.clone();
        let grid = Grid { geometry: map.geometry, cells: &drawn };
        clean(&grid, &MapCleanerParameters::default(), &mut map.cells);
        Some(Self { slam: robot.slam_map_mut()?, map })
    }

    fn grid(&self) -> Grid<'_> {
        Grid { geometry: self.map.geometry, cells: &self.map.cells }
    }

    /// Pose of another robot's map in this one, if it is accepted.
    fn pose_of(&self, other: &Self) -> Option<Pose2> {
        let parameters = RegistrationParameters::default();
        let pair = PreparedPair::new(self.grid(), other.grid(), &parameters.search).ok()?;
        let decision = register(&pair, &UserKnowledge::default(), &parameters).ok()??;
        decision.refusal.is_none().then(|| decision.candidate.transform_a_b())
    }
}

/// Robots whose maps lie to each other as is known, in groups: each after the first with one before it.
fn groups(robots: &[MappedRobot<'_>]) -> Vec<Vec<Member>> {
    let mut left: Vec<usize> = (0..robots.len()).collect();
    let mut groups = Vec::new();
    while !left.is_empty() {
        let mut group = vec![Member { robot: left.remove(0), frame: Pose2::identity() }];
        let mut next = 0;
        while let Some(Member { robot, frame }) = group.get(next) {
            let (robot, frame) = (&robots[*robot], *frame);
            let mut apart = Vec::new();
            for other in left {
                match robot.pose_of(&robots[other]) {
                    Some(pose) => group.push(Member { robot: other, frame: frame * pose }),
                    None => apart.push(other),
                }
            }
            left = apart;
            next += 1;
        }
        groups.push(group);
    }
    groups
}

/// Refines the trajectories of a group. Returns how many are refined with others.
fn refine_group(group: &[Member], robots: &mut [MappedRobot<'_>], parameters: &ScanMapperParameters) -> usize {
    if group.len() < 2 {
        return 0;
    }
    let framed = |Member { robot, frame }: &Member| {
        let slam = &robots[*robot].slam;
        FramedTrajectory { trajectory: slam.trajectory(), frame: frame * slam.transform_map_trajectory() }
    };
    let poses = joint_poses(&group.iter().map(framed).collect::<Vec<_>>());
    let joined = group.iter().zip(poses).filter_map(|(member, poses)| Some((member.robot, poses?)));
    let joined: Vec<(usize, Vec<Pose2>)> = joined.collect();
    let lidars: Vec<Vec<Point2>> = joined.iter().map(|(robot, _)| robots[*robot].slam.lidars()).collect();
    let placed = joined.iter().zip(&lidars);
    let placed = placed.map(|((robot, poses), lidars)| (robots[*robot].slam.trajectory(), &poses[..], &lidars[..]));
    let found = joint_contradictions(&placed.collect::<Vec<_>>());
    let is_right = found.contradicting.len() as f64 <= parameters.max_contradicting * found.revisiting as f64;
    if joined.len() < 2 || !is_right {
        return 0;
    }
    let count = joined.len();
    for (robot, poses) in joined {
        robots[robot].slam.move_to(poses);
    }
    count
}

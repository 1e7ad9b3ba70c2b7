//! The scans of several robots in one pose graph, where their maps show how they lie to each other.

use super::ScanMapperParameters;
use super::robot::Robot;
use super::slam_map::SlamMap;
use crate::mapping::map_cleaner::{MapCleanerParameters, clean};
use crate::mapping::slam::{FramedTrajectory, ScanPoint, Trajectory, joint_contradictions, joint_poses, recorded_map};
use crate::registration::judgement::UserKnowledge;
use crate::registration::{PreparedPair, RegistrationParameters, register};
use crate::shared::geometry::{Grid, Point2, Pose2};
use crate::shared::scan_grid::SnapshotMap;
use crate::shared::walls::{NORMAL_RADIUS, WallMap};
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// A robot with its map without what is no wall.
struct MappedRobot<'a> {
    source: Source<'a>,
    map: SnapshotMap,
}

/// Where the map of a robot is from.
enum Source<'a> {
    /// It is drawn of its scans.
    Scans(&'a mut SlamMap),
    /// The robot has sent it.
    Recorded(Box<Trajectory>),
}

/// A robot of a group, and the pose of its map frame in that of the first.
struct Member {
    robot: usize,
    frame: Pose2,
}

/// Refines the trajectories of robots together whose maps are merged without doubt, each in its own frame as before, with
/// the maps that others have `recorded`, which are rigid. Trajectories of which the scans contradict each other at the
/// common poses stay as they are. Returns how many robots with scans are refined with others.
pub(super) fn refine_together(
    robots: &mut BTreeMap<String, Robot>,
    recorded: &BTreeMap<String, SnapshotMap>,
    parameters: &ScanMapperParameters,
) -> usize {
    let with_scans: Vec<MappedRobot<'_>> = robots.values_mut().filter_map(MappedRobot::of).collect();
    if with_scans.is_empty() {
        return 0;
    }
    let recorded = recorded.values().filter_map(MappedRobot::of_map);
    let mut mapped: Vec<MappedRobot<'_>> = recorded.chain(with_scans).collect();
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
        let map = cleaned(robot.map()?)?;
        Some(Self { source: Source::Scans(robot.slam_map_mut()?), map })
    }

    /// A robot that has sent its map; none if that is invalid or has no walls.
    fn of_map(map: &SnapshotMap) -> Option<Self> {
        let map = cleaned(map.clone())?;
        let walls = WallMap::new(&Grid { geometry: map.geometry, cells: &map.cells }, NORMAL_RADIUS);
        let point = |(place, normal): (&Point2, &Vector2<f64>)| ScanPoint {
            place: *place,
            normal: Some(*normal).filter(|normal| *normal != Vector2::zeros()),
        };
        let points = walls.walls.points().iter().zip(&walls.normals).map(point);
        (!walls.normals.is_empty()).then(|| Self { source: Source::Recorded(Box::new(recorded_map(points))), map })
    }

    fn trajectory(&self) -> &Trajectory {
        match &self.source {
            Source::Scans(slam) => slam.trajectory(),
            Source::Recorded(trajectory) => trajectory,
        }
    }

    /// Pose of the frame of the trajectory in the map.
    fn transform_map_trajectory(&self) -> Pose2 {
        match &self.source {
            Source::Scans(slam) => slam.transform_map_trajectory(),
            Source::Recorded(_) => Pose2::identity(),
        }
    }

    fn is_recorded(&self) -> bool {
        matches!(self.source, Source::Recorded(_))
    }

    fn grid(&self) -> Grid<'_> {
        Grid { geometry: self.map.geometry, cells: &self.map.cells }
    }

    /// Pose of another robot's map in this one, if it is accepted. Nothing is to be refined of two recorded maps.
    fn pose_of(&self, other: &Self) -> Option<Pose2> {
        if self.is_recorded() && other.is_recorded() {
            return None;
        }
        let parameters = RegistrationParameters::default();
        let pair = PreparedPair::new(self.grid(), other.grid(), &parameters.search).ok()?;
        let decision = register(&pair, &UserKnowledge::default(), &parameters).ok()??;
        decision.refusal.is_none().then(|| decision.candidate.transform_a_b())
    }
}

/// A map without what is no wall; none if it is invalid.
fn cleaned(mut map: SnapshotMap) -> Option<SnapshotMap> {
    let drawn = map.cells.clone();
    clean(&Grid::new(map.geometry, &drawn).ok()?, &MapCleanerParameters::default(), &mut map.cells);
    Some(map)
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
        let robot = &robots[*robot];
        FramedTrajectory { trajectory: robot.trajectory(), frame: frame * robot.transform_map_trajectory() }
    };
    let poses = joint_poses(&group.iter().map(framed).collect::<Vec<_>>());
    let joined = group.iter().zip(poses).filter_map(|(member, poses)| Some((member.robot, poses?)));
    let joined: Vec<(usize, Vec<Pose2>)> = joined.collect();
    let placed = joined.iter().map(|(robot, poses)| (robots[*robot].trajectory(), &poses[..]));
    let found = joint_contradictions(&placed.collect::<Vec<_>>());
    if joined.len() < 2 || found.are_more_than(parameters.max_contradicting) {
        return 0;
    }
    let mut count = 0;
    for (robot, poses) in joined {
        let Source::Scans(slam) = &mut robots[robot].source else { continue };
        let alone = slam.trajectory().poses().to_vec();
        slam.move_to(poses);
        slam.test(true);
        // Of a few scans among many of others all may contradict each other.
        match slam.bad_scans() {
            Some(_) => slam.move_to(alone),
            None => count += 1,
        }
    }
    count
}

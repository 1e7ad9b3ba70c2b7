//! The scans of several robots, and of several sessions of one, in one pose graph, where their maps show how they lie to each
//! other.

use super::ScanMapperParameters;
use super::robot::Robot;
use super::sessions::Sessions;
use super::slam_map::SlamMap;
use crate::mapping::map_cleaner::{MapCleanerParameters, clean};
use crate::mapping::slam::{FramedTrajectory, ScanPoint, Trajectory, joint_contradictions, joint_poses, recorded_map};
use crate::registration::judgement::UserKnowledge;
use crate::registration::{PreparedPair, RegistrationParameters, register};
use crate::shared::geometry::{Grid, Point2, Pose2};
use crate::shared::scan_grid::SnapshotMap;
use crate::shared::walls::{NORMAL_RADIUS, WallMap};
use nalgebra::Vector2;

/// A map without what is no wall.
struct MappedRobot<'a> {
    source: Source<'a>,
    map: SnapshotMap,
}

/// Where a map is from.
enum Source<'a> {
    /// It is drawn of the scans of a session of a robot, which are numbers.
    Scans { slam: &'a mut SlamMap, robot: usize, session: usize },
    /// A robot has sent it.
    Recorded(Box<Trajectory>),
}

/// A map of a group, and the pose of its frame in that of the first.
struct Member {
    robot: usize,
    frame: Pose2,
}

/// The poses of the scans of a session, in the frame that its group has in common.
struct JointSession {
    robot: usize,
    session: usize,
    poses: Vec<Pose2>,
}

/// Refines the trajectories of robots together whose maps are merged without doubt, each in its own frame as before, with
/// the maps that others have recorded, which are rigid; then each robot goes on with its later sessions in its first one, where
/// these are among them. Trajectories of which the scans contradict each other at the common poses stay as they are. Returns how
/// many robots with scans are refined with others.
pub(super) fn refine_together<'a>(
    robots: &mut [&mut Robot],
    recorded: impl Iterator<Item = &'a SnapshotMap>,
    parameters: &ScanMapperParameters,
) -> usize {
    let mut with_scans = Vec::new();
    for (number, robot) in robots.iter_mut().enumerate() {
        let sessions = robot.sessions_mut().into_iter().flat_map(Sessions::all_mut).enumerate();
        with_scans.extend(sessions.filter_map(|(session, slam)| MappedRobot::of(slam, number, session)));
    }
    if with_scans.is_empty() {
        return 0;
    }
    let recorded = recorded.filter_map(MappedRobot::of_map);
    let mut mapped: Vec<MappedRobot<'_>> = recorded.chain(with_scans).collect();
    let groups = groups(&mapped);
    let refined: Vec<Vec<JointSession>> =
        groups.iter().map(|group| refine_group(group, &mut mapped, parameters)).collect();
    for group in &refined {
        for (number, robot) in robots.iter_mut().enumerate().filter(|(_, robot)| robot.session_count() > 1) {
            let poses = |session| group.iter().find(|joint| (joint.robot, joint.session) == (number, session));
            let count = robot.session_count();
            let poses: Vec<Option<&[Pose2]>> = (0..count).map(|session| Some(&poses(session)?.poses[..])).collect();
            robot.join_sessions(&poses, parameters);
        }
    }
    (0..robots.len()).filter(|robot| refined.iter().flatten().any(|joint| joint.robot == *robot)).count()
}

impl<'a> MappedRobot<'a> {
    /// A map that is built by SLAM, if it is right as far as its own scans show.
    fn of(slam: &'a mut SlamMap, robot: usize, session: usize) -> Option<Self> {
        slam.test(true);
        if slam.bad_scans().is_some() || slam.is_mirrored() {
            return None;
        }
        let map = cleaned(slam.snapshot()?)?;
        Some(Self { source: Source::Scans { slam, robot, session }, map })
    }

    /// A map that a robot has sent; none if that is invalid or has no walls.
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
            Source::Scans { slam, .. } => slam.trajectory(),
            Source::Recorded(trajectory) => trajectory,
        }
    }

    /// Pose of the frame of the trajectory in the map.
    fn transform_map_trajectory(&self) -> Pose2 {
        match &self.source {
            Source::Scans { slam, .. } => slam.transform_map_trajectory(),
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

/// Refines the trajectories of a group. Returns the sessions that are refined with others.
fn refine_group(
    group: &[Member],
    robots: &mut [MappedRobot<'_>],
    parameters: &ScanMapperParameters,
) -> Vec<JointSession> {
    if group.len() < 2 {
        return Vec::new();
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
        return Vec::new();
    }
    let mut refined = Vec::new();
    for (number, poses) in joined {
        let Source::Scans { slam, robot, session } = &mut robots[number].source else { continue };
        let alone = slam.trajectory().poses().to_vec();
        slam.move_to(poses.clone());
        slam.test(true);
        // Of a few scans among many of others all may contradict each other.
        match slam.bad_scans() {
            Some(_) => slam.move_to(alone),
            None => refined.push(JointSession { robot: *robot, session: *session, poses }),
        }
    }
    refined
}

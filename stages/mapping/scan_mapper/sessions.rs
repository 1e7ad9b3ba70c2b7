//! The sessions of a robot that loses its way on a drive.
//!
//! Where a robot is not known any more, for instance after a gap in which neither scans nor odometry were recorded, a new
//! session begins with a map of its own (as in multi-session SLAM: McDonald et al. 2013, "Real-time 6-DOF multi-session
//! visual SLAM over large-scale environments"). At the end its map is merged with that of the first session as that of
//! another robot would be, and where it is accepted, the first session goes on with it. The others are left out.

use super::ScanMapperParameters;
use super::slam_map::{LostWay, SlamMap, TagSighting};
use crate::mapping::slam::joint_contradictions;
use crate::shared::geometry::Pose2;
use gridweave_runtime::message::LogTime;

/// The most sessions of a drive. Who loses the way more often has bad scans, and each is compared with all others.
const MOST_SESSIONS: usize = 12;

/// The maps of a robot, one for each session.
pub(super) struct Sessions {
    first: SlamMap,
    later: Vec<SlamMap>,
}

impl Sessions {
    pub(super) fn new(parameters: &ScanMapperParameters) -> Self {
        Self { first: SlamMap::new(parameters), later: Vec::new() }
    }

    /// That of the first session, which is the map of the robot.
    pub(super) fn first(&self) -> &SlamMap {
        &self.first
    }

    /// The same, to be changed.
    pub(super) fn first_mut(&mut self) -> &mut SlamMap {
        &mut self.first
    }

    /// The session to which scans are added.
    pub(super) fn current(&mut self) -> &mut SlamMap {
        self.later.last_mut().unwrap_or(&mut self.first)
    }

    /// All sessions, in the order of time.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut SlamMap> {
        std::iter::once(&mut self.first).chain(&mut self.later)
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        1 + self.later.len()
    }

    /// Ends the current session, and begins another one, if there are not too many.
    pub(super) fn begin(&mut self, lost: LostWay, parameters: &ScanMapperParameters) {
        self.current().lose_way(lost);
        if self.count() < MOST_SESSIONS {
            self.later.push(SlamMap::new(parameters));
        }
    }

    /// Adds the position at which a tag was seen from the pose `odometry`, to the session of that time.
    pub(super) fn see(&mut self, time: LogTime, odometry: &Pose2, tag: &TagSighting) {
        self.all_mut().for_each(|session| session.see(time, odometry, tag));
    }

    /// Looks for the last loop closures, when there will be no more scans.
    pub(super) fn finish(&mut self) {
        self.all_mut().for_each(SlamMap::finish);
    }

    /// Goes on with later sessions in the first one. `poses` are those of the scans of each session, the first of them too, in one
    /// frame; none where they are not known. Sessions after one that is not known, or whose scans contradict those before,
    /// are left out.
    pub(super) fn join(&mut self, poses: &[Option<&[Pose2]>], max_contradicting: f64) {
        let Some((Some(first), later)) = poses.split_first() else { return };
        let Some(common) = first.first().zip(self.first.trajectory().poses().first()) else { return };
        let transform_first_common = common.1 * common.0.inverse();
        let known: Vec<&[Pose2]> = later.iter().map_while(|poses| *poses).collect();
        for (session, poses) in self.later.drain(..known.len()).zip(known) {
            let poses: Vec<Pose2> = poses.iter().map(|pose| transform_first_common * pose).collect();
            let before = self.first.trajectory();
            let found = joint_contradictions(&[(before, before.poses()), (session.trajectory(), &poses)]);
            if found.are_more_than(max_contradicting) {
                break;
            }
            self.first.append(session, poses);
        }
    }
}

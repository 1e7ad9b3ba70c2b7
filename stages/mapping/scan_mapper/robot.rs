//! One robot with its scans and poses.

use super::along_odometry::{ScanTimes, add_along_odometry};
use super::continuous_odometry::ContinuousOdometry;
use super::scan_odometry::ScanOdometry;
use super::scan_usage::ScanUsage;
use super::sessions::Sessions;
use super::slam_map::{BadScans, LossCause, LostWay, SlamMap, TagSighting};
use super::{ScanBeams, ScanMap, ScanMapperParameters, TooLarge};
use crate::mapping::slam::{Contradictions, OdometryCorrection};
use crate::shared::geometry::{Point2, Pose2, pose};
use crate::shared::robot_clock::RobotClock;
use crate::shared::scan_grid::SnapshotMap;
use crate::tags::tag_localizer::{PoseTrack, Position};
use gridweave_runtime::message::LogTime;
use std::collections::VecDeque;

/// Scans wait for a later pose for at most this long, seconds: poses are kept as long.
const PATIENCE: f64 = 10.0;

/// Source of the robot's poses.
enum Localization {
    /// No messages so far, or odometry only, and not for long.
    NotYet,
    /// By poses in its map.
    ByPoses(ScanMap),
    /// By odometry and the registration of scans.
    ByOdometry(Sessions),
    /// By the registration of scans alone.
    ByScans(Sessions, ScanOdometry),
}

/// Outcome of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScanOutcome {
    /// It is in the map, or need not be: another one from nearly the same pose is, or it is the last.
    Used,
    /// No pose of the robot is known.
    NoPose,
    /// It lies on no earlier one: it was added at the pose by odometry.
    NotMatched,
    /// The map would get too large.
    TooLarge,
}

/// A robot whose map is built.
pub(super) struct Robot {
    pub(super) clock: RobotClock,
    localization: Localization,
    poses: PoseTrack,
    odometry: PoseTrack,
    /// What the track of odometry is made of.
    continuous: ContinuousOdometry,
    /// All of odometry, where poses are sent at the end.
    kept_odometry: Vec<(LogTime, Pose2)>,
    /// The frame of the poses.
    pub(super) frame: Option<String>,
    waiting: VecDeque<(LogTime, ScanBeams)>,
    /// Times of the scans whose poses by odometry are known.
    placed: ScanTimes,
    /// Tags that were seen, for which no pose is known so far.
    waiting_tags: VecDeque<(LogTime, TagSighting)>,
    /// The scans so far, and the times of the poses.
    pub(super) usage: ScanUsage,
    /// Times of the first and the last scan in the map.
    pub(super) drawn: Option<[LogTime; 2]>,
    /// Time of the last scan in the map that was sent.
    pub(super) sent_until: Option<LogTime>,
    /// Whether it was reported that it has lost its way and has scans from then on.
    is_loss_reported: bool,
}

impl Robot {
    pub(super) fn new() -> Self {
        Self {
            clock: RobotClock::default(),
            localization: Localization::NotYet,
            poses: PoseTrack::default(),
            odometry: PoseTrack::default(),
            continuous: ContinuousOdometry::default(),
            kept_odometry: Vec::new(),
            frame: None,
            waiting: VecDeque::new(),
            placed: ScanTimes::default(),
            waiting_tags: VecDeque::new(),
            usage: ScanUsage::default(),
            drawn: None,
            sent_until: None,
            is_loss_reported: false,
        }
    }

    /// Adds a scan with its time.
    pub(super) fn add_scan(&mut self, time: LogTime, scan: ScanBeams) {
        self.usage.add_scan(time);
        self.waiting.push_back((time, scan));
    }

    /// Adds a tag that was seen at a time. It counts where poses are found by SLAM.
    pub(super) fn add_tag(&mut self, time: LogTime, tag: TagSighting) {
        if !matches!(self.localization, Localization::ByPoses(_)) {
            self.waiting_tags.push_back((time, tag));
        }
        while self.waiting_tags.front().is_some_and(|(first, _)| time.seconds_since(*first) > PATIENCE) {
            self.waiting_tags.pop_front();
        }
    }

    /// Adds the tags for whose times odometry is known, and at the end of the log the remaining ones as well.
    fn place_tags(&mut self, parameters: &ScanMapperParameters, is_end: bool) {
        if !self.is_by_slam() {
            return;
        }
        let latest = self.odometry.latest_time();
        let next_scan = self.waiting.front().map(|(time, _)| *time);
        while let Some((time, tag)) = self.waiting_tags.pop_front() {
            let is_due = latest.is_some_and(|latest| latest >= time) && next_scan.is_none_or(|next| next > time);
            if !is_due && !is_end {
                self.waiting_tags.push_front((time, tag));
                break;
            }
            let Some(at) = pose_at(&self.odometry, time, parameters) else { continue };
            if let Some(sessions) = self.sessions_mut() {
                sessions.see(time, &at, &tag);
            }
        }
    }

    /// Adds a pose in the map. Returns `false` if it is not used, as the map is built by odometry already, or as it
    /// is late.
    pub(super) fn add_pose(&mut self, time: LogTime, pose: &Pose2, parameters: &ScanMapperParameters) -> bool {
        match self.localization {
            Localization::ByOdometry(_) | Localization::ByScans(..) => return false,
            Localization::NotYet => {
                self.localization = Localization::ByPoses(ScanMap::new(parameters));
                self.kept_odometry = Vec::new();
            }
            Localization::ByPoses(_) => {}
        }
        self.usage.add_pose(time);
        self.poses.add(time, position(pose))
    }

    /// Adds a pose by odometry, and keeps it if `is_kept`. Returns it, without the leaps of odometry so far; `None` if
    /// it is late, or comes after the start of the map without it.
    pub(super) fn add_odometry(&mut self, time: LogTime, pose: &Pose2, is_kept: bool) -> Option<Pose2> {
        let is_late = self.odometry.latest_time().is_some_and(|latest| time < latest);
        if is_late || matches!(self.localization, Localization::ByScans(..)) {
            return None;
        }
        self.usage.add_pose(time);
        let pose = self.continuous.follow(time, pose);
        self.odometry.add(time, position(&pose));
        if is_kept && !matches!(self.localization, Localization::ByPoses(_)) {
            self.kept_odometry.push((time, pose));
        }
        Some(pose)
    }

    /// Seconds from the first scan to the first leap of odometry, if it has leapt.
    pub(super) fn odometry_leap(&self) -> Option<f64> {
        Some(self.continuous.first_leap()?.seconds_since(self.usage.first()?))
    }

    /// Number of its scans, if they are registered along odometry that has never moved.
    pub(super) fn scans_at_a_standstill(&self) -> Option<usize> {
        let is_by_odometry = matches!(self.localization, Localization::ByOdometry(_));
        (is_by_odometry && self.continuous.stands_still()).then_some(self.usage.count())
    }

    /// Why none of its scans is in a map. `None` if it has sent none, or one is.
    pub(super) fn why_none_is_used(&self) -> Option<String> {
        self.usage.why_none().filter(|_| self.drawn.is_none())
    }

    /// Takes the odometry that was kept.
    pub(super) fn take_odometry(&mut self) -> Vec<(LogTime, Pose2)> {
        std::mem::take(&mut self.kept_odometry)
    }

    /// The maps whose poses are found by SLAM; `None` if the robot has other poses, or none yet.
    fn sessions(&self) -> Option<&Sessions> {
        match &self.localization {
            Localization::ByOdometry(sessions) | Localization::ByScans(sessions, _) => Some(sessions),
            Localization::NotYet | Localization::ByPoses(_) => None,
        }
    }

    /// The same, to be changed.
    pub(super) fn sessions_mut(&mut self) -> Option<&mut Sessions> {
        match &mut self.localization {
            Localization::ByOdometry(sessions) | Localization::ByScans(sessions, _) => Some(sessions),
            Localization::NotYet | Localization::ByPoses(_) => None,
        }
    }

    /// That of the first session, which is the map of the robot.
    fn slam_map(&self) -> Option<&SlamMap> {
        self.sessions().map(Sessions::first)
    }

    /// Whether its poses are found by SLAM.
    pub(super) fn is_by_slam(&self) -> bool {
        self.slam_map().is_some()
    }

    /// Pose in the map for a pose by odometry; `None` if the robot has other poses, or none yet, or has lost its way.
    pub(super) fn in_map(&self, time: LogTime, odometry: &Pose2) -> Option<Pose2> {
        self.slam_map()?.in_map(time, odometry)
    }

    /// Length of its ways as a share of that by odometry, if its scans are registered along odometry.
    pub(super) fn odometry_scale(&self) -> Option<f64> {
        match &self.localization {
            Localization::ByOdometry(sessions) => Some(sessions.first().odometry_scale()),
            _ => None,
        }
    }

    /// What turns its ways by odometry into those by its scans, and the yaw of its lidar as it is given, radians. `None` if it is
    /// not steady, or its scans are not registered along odometry.
    pub(super) fn odometry_correction(&self) -> Option<(OdometryCorrection, f64)> {
        match &self.localization {
            Localization::ByOdometry(sessions) => {
                let first = sessions.first();
                first.odometry_correction().map(|correction| (correction, first.lidar_yaw()))
            }
            _ => None,
        }
    }

    /// Whether none of its scans, which are registered, has hit anything.
    pub(super) fn sees_nothing(&self) -> bool {
        self.slam_map().is_some_and(SlamMap::sees_nothing)
    }

    /// Seconds from the first scan to where it has lost its way, and why.
    pub(super) fn lost_way(&self) -> Option<(f64, LossCause)> {
        let LostWay { time, cause } = self.slam_map()?.lost_way()?;
        Some((time.seconds_since(self.usage.first()?), cause))
    }

    /// Seconds from the first scan to where it has lost its way with scans from then on; given once.
    pub(super) fn take_new_session(&mut self) -> Option<f64> {
        let (seconds, _) = self.lost_way().filter(|_| self.session_count() > 1 && !self.is_loss_reported)?;
        self.is_loss_reported = true;
        Some(seconds)
    }

    /// Starts to register scans, along odometry if there is any, once no poses came for long enough or none will come.
    pub(super) fn decide(&mut self, parameters: &ScanMapperParameters, is_end: bool) {
        let (Localization::NotYet, Some(first)) = (&self.localization, self.usage.first()) else { return };
        let has_waited = |latest: LogTime| is_end || latest.seconds_since(first) >= parameters.wait_for_poses;
        match (self.odometry.latest_time(), self.waiting.back()) {
            (Some(latest), _) if has_waited(latest) => {
                self.localization = Localization::ByOdometry(Sessions::new(parameters));
            }
            (None, Some((newest, _))) if has_waited(*newest) => {
                self.localization = Localization::ByScans(Sessions::new(parameters), ScanOdometry::default());
            }
            _ => {}
        }
    }

    /// Adds the scans for whose beams poses are known, and at the end of the log the remaining ones as well. Calls
    /// `outcome` for each.
    pub(super) fn draw(
        &mut self,
        parameters: &ScanMapperParameters,
        is_end: bool,
        mut outcome: impl FnMut(ScanOutcome),
    ) {
        if let Localization::ByScans(sessions, odometry) = &mut self.localization {
            // Without odometry a robot that has lost its way begins no other session.
            let slam = sessions.current();
            for (time, scan) in self.waiting.drain(..) {
                if slam.lost_way().is_some() {
                    continue;
                }
                let scan = scan.without_motion(|delay| Some(odometry.motion(delay)));
                let at = odometry.pose(time, &scan, slam, parameters);
                self.kept_odometry.push((time, at));
                self.odometry.add(time, position(&at));
                let is_due = slam.is_due(time, &at, parameters);
                let is_matched = !is_due || slam.add(time, &at, &at, &scan);
                outcome(if is_matched { ScanOutcome::Used } else { ScanOutcome::NotMatched });
            }
        } else {
            self.draw_at_poses(parameters, is_end, outcome);
        }
        self.place_tags(parameters, is_end);
        if let Some(sessions) = self.sessions_mut().filter(|_| is_end) {
            sessions.finish();
        }
        self.update_times();
    }

    /// The times of the first and the last scan in the map, where its poses are found by SLAM.
    fn update_times(&mut self) {
        if let Some(slam) = self.slam_map() {
            self.drawn = slam.times();
        }
    }

    /// Number of its sessions: several where it has lost its way and has scans from then on.
    pub(super) fn session_count(&self) -> usize {
        self.sessions().map_or(0, Sessions::count)
    }

    /// Goes on with later sessions in the first one, where the poses of their scans are known in one frame.
    pub(super) fn join_sessions(&mut self, poses: &[Option<&[Pose2]>], parameters: &ScanMapperParameters) {
        if let Some(sessions) = self.sessions_mut() {
            sessions.join(poses, parameters.max_contradicting);
        }
        self.update_times();
    }

    /// Adds the scans for whose beams poses are known, by a localizer or by odometry.
    fn draw_at_poses(&mut self, parameters: &ScanMapperParameters, is_end: bool, mut outcome: impl FnMut(ScanOutcome)) {
        let latest = match self.localization {
            Localization::NotYet | Localization::ByScans(..) => None,
            Localization::ByPoses(_) => self.poses.latest_time(),
            Localization::ByOdometry(_) => self.odometry.latest_time(),
        };
        while let Some((time, scan)) = self.waiting.front() {
            let is_due = latest.is_some_and(|latest| latest >= time.plus_seconds(scan.duration));
            let newest = self.waiting.back().map_or(*time, |(newest, _)| *newest);
            if !is_due && !is_end && newest.seconds_since(*time) < PATIENCE {
                break;
            }
            let Some((time, scan)) = self.waiting.pop_front() else { break };
            outcome(match &mut self.localization {
                // The last scan of a log has no pose after its end.
                _ if !is_due && latest.is_some_and(|latest| latest >= time) => ScanOutcome::Used,
                _ if !is_due => ScanOutcome::NoPose,
                Localization::NotYet | Localization::ByScans(..) => ScanOutcome::NoPose,
                Localization::ByPoses(map) => {
                    let drawn = draw_by_poses(map, &self.poses, time, &scan, parameters);
                    match drawn {
                        ScanOutcome::Used => self.drawn = Some([self.drawn.map_or(time, |[first, _]| first), time]),
                        ScanOutcome::TooLarge => self.usage.leave_out(),
                        ScanOutcome::NoPose | ScanOutcome::NotMatched => {}
                    }
                    drawn
                }
                Localization::ByOdometry(sessions) => {
                    let blind = self.continuous.blind_pause();
                    add_along_odometry(sessions, &self.odometry, &mut self.placed, blind, (time, &scan), parameters)
                }
            });
        }
    }

    /// The map so far, `None` if nothing is known.
    pub(super) fn map(&mut self) -> Option<SnapshotMap> {
        match &mut self.localization {
            Localization::NotYet => None,
            Localization::ByPoses(map) => map.snapshot(),
            Localization::ByOdometry(sessions) | Localization::ByScans(sessions, _) => sessions.first_mut().snapshot(),
        }
    }

    /// Takes the number of scans that were left out of the map by SLAM since the last time, as it would get too large.
    pub(super) fn take_left_out(&mut self) -> usize {
        self.sessions_mut().map_or(0, |sessions| sessions.first_mut().take_left_out())
    }

    /// Whether its scans turn against its odometry.
    pub(super) fn is_mirrored(&self) -> bool {
        self.slam_map().is_some_and(SlamMap::is_mirrored)
    }

    /// Tests the map that is built by SLAM, at the end in any case: how often its scans contradict each other.
    pub(super) fn test_map(&mut self, is_end: bool) -> Option<&Contradictions> {
        let slam = self.sessions_mut()?.first_mut();
        slam.test(is_end);
        slam.contradictions()
    }

    /// Whether so many of its scans lie on no others, or by the last test contradict others, that there is no map of them.
    pub(super) fn bad_scans(&self) -> Option<BadScans> {
        self.slam_map()?.bad_scans()
    }
}

fn draw_by_poses(
    map: &mut ScanMap,
    poses: &PoseTrack,
    time: LogTime,
    scan: &ScanBeams,
    parameters: &ScanMapperParameters,
) -> ScanOutcome {
    let at = |delay: f64| pose_at(poses, time.plus_seconds(delay), parameters);
    // If the poses at the beginning and the end of a scan are known, those between are.
    if at(0.0).is_none() || at(scan.duration).is_none() {
        return ScanOutcome::NoPose;
    }
    match map.draw(scan, at) {
        Ok(()) => ScanOutcome::Used,
        Err(TooLarge) => ScanOutcome::TooLarge,
    }
}

fn position(pose: &Pose2) -> Position {
    Position { yaw: pose.rotation.angle(), ..Position::new(Point2::from(pose.translation.vector)) }
}

/// The pose on a track at a time; `None` if none is known near it.
pub(super) fn pose_at(track: &PoseTrack, time: LogTime, parameters: &ScanMapperParameters) -> Option<Pose2> {
    let Position { place, yaw, .. } = track.position(time, parameters.max_pose_age).ok()?;
    Some(pose(place.x, place.y, yaw))
}

//! One robot with its scans and poses.

use super::{Motion, ScanBeams, ScanMap, ScanMapperParameters, TooLarge, match_scan};
use crate::shared::geometry::{Point2, Pose2, pose};
use crate::tags::tag_localizer::{PoseTrack, Position};
use gridweave_runtime::message::LogTime;
use std::collections::VecDeque;

/// Scans wait for a later pose for at most this long, seconds: poses are kept as long.
const PATIENCE: f64 = 10.0;

/// Source of the robot's poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// No messages so far, or odometry only, and not for long.
    NotYet,
    /// By poses in its map.
    ByPoses,
    /// By odometry, with which scans are matched.
    ByOdometry,
}

/// Outcome of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScanOutcome {
    /// It is in the map, or need not be: another one from nearly the same pose is, or it is the last.
    Used,
    /// No pose of the robot is known.
    NoPose,
    /// The walls do not constrain its pose: it was added at the pose by odometry.
    NotMatched,
    /// The map would get too large.
    TooLarge,
}

/// A robot whose map is built.
pub(super) struct Robot {
    known: Known,
    poses: PoseTrack,
    odometry: PoseTrack,
    /// The frame of the poses.
    pub(super) frame: Option<String>,
    waiting: VecDeque<(LogTime, ScanBeams)>,
    first_scan: Option<LogTime>,
    pub(super) map: ScanMap,
    /// Pose in the map at which the odometry of a robot without poses began.
    transform_map_odometry: Pose2,
    /// Pose by odometry at the last matched scan.
    last_step: Option<Pose2>,
    /// Time of the last scan in the map.
    pub(super) drawn_until: Option<LogTime>,
    /// Time of the first scan in the map.
    pub(super) first_drawn: Option<LogTime>,
    /// Time of the last scan in the map that was sent.
    pub(super) sent_until: Option<LogTime>,
}

impl Robot {
    pub(super) fn new(parameters: &ScanMapperParameters) -> Self {
        Self {
            known: Known::NotYet,
            poses: PoseTrack::default(),
            odometry: PoseTrack::default(),
            frame: None,
            waiting: VecDeque::new(),
            first_scan: None,
            map: ScanMap::new(parameters),
            transform_map_odometry: Pose2::identity(),
            last_step: None,
            drawn_until: None,
            first_drawn: None,
            sent_until: None,
        }
    }

    /// Adds a scan with its time.
    pub(super) fn add_scan(&mut self, time: LogTime, scan: ScanBeams) {
        self.first_scan.get_or_insert(time);
        self.waiting.push_back((time, scan));
    }

    /// Adds a pose in the map. Returns `false` if it is not used, as the map is built by odometry already, or as it
    /// is late.
    pub(super) fn add_pose(&mut self, time: LogTime, pose: &Pose2) -> bool {
        if self.known == Known::ByOdometry {
            return false;
        }
        self.known = Known::ByPoses;
        self.poses.add(time, position(pose))
    }

    /// Adds a pose by odometry. Returns `false` if it is late.
    pub(super) fn add_odometry(&mut self, time: LogTime, pose: &Pose2) -> bool {
        self.odometry.add(time, position(pose))
    }

    /// Whether the stage sends poses of the robot, as it has no others.
    pub(super) fn is_by_odometry(&self) -> bool {
        self.known == Known::ByOdometry
    }

    /// Pose in the map for a pose by odometry.
    pub(super) fn in_map(&self, odometry: &Pose2) -> Pose2 {
        self.transform_map_odometry * odometry
    }

    /// Starts to match scans along odometry, if no poses came for long enough or none will come.
    pub(super) fn decide(&mut self, parameters: &ScanMapperParameters, is_end: bool) {
        let (Known::NotYet, Some(first), Some(latest)) = (self.known, self.first_scan, self.odometry.latest_time())
        else {
            return;
        };
        if is_end || latest.seconds_since(first) >= parameters.wait_for_poses {
            self.known = Known::ByOdometry;
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
        loop {
            let latest = match self.known {
                Known::NotYet => None,
                Known::ByPoses => self.poses.latest_time(),
                Known::ByOdometry => self.odometry.latest_time(),
            };
            let Some((time, scan)) = self.waiting.front() else { return };
            let is_due = latest.is_some_and(|latest| latest >= time.plus_seconds(scan.duration));
            let newest = self.waiting.back().map_or(*time, |(newest, _)| *newest);
            if !is_due && !is_end && newest.seconds_since(*time) < PATIENCE {
                return;
            }
            let Some((time, scan)) = self.waiting.pop_front() else { return };
            outcome(match self.known {
                // The last scan of a log has no pose after its end.
                _ if !is_due && latest.is_some_and(|latest| latest >= time) => ScanOutcome::Used,
                _ if !is_due => ScanOutcome::NoPose,
                Known::NotYet => ScanOutcome::NoPose,
                Known::ByPoses => self.draw_by_poses(time, &scan, parameters),
                Known::ByOdometry => self.draw_by_odometry(time, &scan, parameters),
            });
        }
    }

    fn draw_by_poses(&mut self, time: LogTime, scan: &ScanBeams, parameters: &ScanMapperParameters) -> ScanOutcome {
        let at = |delay: f64| pose_at(&self.poses, time.plus_seconds(delay), parameters);
        // If the poses at the beginning and the end of a scan are known, those between are.
        if at(0.0).is_none() || at(scan.duration).is_none() {
            return ScanOutcome::NoPose;
        }
        match self.map.draw(scan, at) {
            Ok(()) => {
                self.drawn_until = Some(time);
                ScanOutcome::Used
            }
            Err(TooLarge) => ScanOutcome::TooLarge,
        }
    }

    fn draw_by_odometry(&mut self, time: LogTime, scan: &ScanBeams, parameters: &ScanMapperParameters) -> ScanOutcome {
        let Some(start) = pose_at(&self.odometry, time, parameters) else { return ScanOutcome::NoPose };
        let mut outcome = ScanOutcome::Used;
        if let Some(last) = self.last_step {
            let moved = last.inverse() * start;
            let motion = Motion { way: moved.translation.vector.norm(), turn: moved.rotation.angle().abs() };
            if motion.way < parameters.step && motion.turn < parameters.step_yaw {
                return ScanOutcome::Used;
            }
            let guess = self.transform_map_odometry * start;
            // The relative poses of the beams of one scan are those of odometry.
            let still = self.without_motion(time, scan, &start, parameters);
            match match_scan(&self.map, &still, &guess, motion, parameters) {
                Some(found) => self.transform_map_odometry = found * start.inverse(),
                None => outcome = ScanOutcome::NotMatched,
            }
        }
        self.last_step = Some(start);
        let (track, transform) = (&self.odometry, self.transform_map_odometry);
        let at = |delay: f64| Some(transform * pose_at(track, time.plus_seconds(delay), parameters)?);
        match self.map.draw(scan, at) {
            Ok(()) => {
                self.drawn_until = Some(time);
                outcome
            }
            Err(TooLarge) => ScanOutcome::TooLarge,
        }
    }

    /// The scan of a robot that stands still at `start`.
    fn without_motion(
        &self,
        time: LogTime,
        scan: &ScanBeams,
        start: &Pose2,
        parameters: &ScanMapperParameters,
    ) -> ScanBeams {
        let mut still = scan.clone();
        if scan.duration == 0.0 {
            return still;
        }
        let transform_lidar_base = scan.transform_base_lidar.inverse();
        for beam in &mut still.beams {
            let Some(base) = pose_at(&self.odometry, time.plus_seconds(beam.delay), parameters) else { continue };
            let (sine, cosine) = beam.angle.sin_cos();
            let end = Point2::new(cosine * beam.range, sine * beam.range);
            let end = transform_lidar_base * (start.inverse() * (base * (scan.transform_base_lidar * end)));
            (beam.angle, beam.range, beam.delay) = (end.y.atan2(end.x), end.coords.norm(), 0.0);
        }
        still.duration = 0.0;
        still
    }
}

fn position(pose: &Pose2) -> Position {
    Position { yaw: pose.rotation.angle(), ..Position::new(Point2::from(pose.translation.vector)) }
}

fn pose_at(track: &PoseTrack, time: LogTime, parameters: &ScanMapperParameters) -> Option<Pose2> {
    let Position { place, yaw, .. } = track.position(time, parameters.max_pose_age).ok()?;
    Some(pose(place.x, place.y, yaw))
}

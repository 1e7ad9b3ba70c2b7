//! One robot, its scans, and where it was.

use super::{DrawnMap, Motion, ScanBeams, ScanMapperParameters, TooLarge, match_scan};
use crate::shared::geometry::{Point2, Pose2, pose};
use crate::tags::tag_localizer::{PoseTrack, Position};
use gridweave_runtime::message::LogTime;
use std::collections::VecDeque;

/// Scans wait for a pose behind them for at most so long, seconds: poses are kept as long.
const PATIENCE: f64 = 10.0;

/// By what it is known where the robot is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// Nothing was said yet, or odometry alone, and not for long.
    NotYet,
    /// By poses in its map.
    ByPoses,
    /// By odometry, with which scans are matched.
    ByOdometry,
}

/// What became of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// It is in the map, or need not be: another from nearly the same place is, or it is the last.
    Used,
    /// Nothing says where the robot was.
    NoPose,
    /// The walls did not tell where it belongs: it was laid where odometry has it.
    NotMatched,
    /// The map would have got too large.
    TooLarge,
}

/// A robot whose map is drawn.
pub(super) struct Robot {
    known: Known,
    poses: PoseTrack,
    odometry: PoseTrack,
    /// The frame of the poses.
    pub(super) frame: Option<String>,
    waiting: VecDeque<(LogTime, ScanBeams)>,
    first_scan: Option<LogTime>,
    pub(super) map: DrawnMap,
    /// Where the odometry of a robot without poses began lies in its map.
    transform_map_odometry: Pose2,
    /// Where odometry had the robot when the last scan was matched.
    last_step: Option<Pose2>,
    /// When the last scan that is in the map was made.
    pub(super) drawn_until: Option<LogTime>,
    /// When the first one was made.
    pub(super) first_drawn: Option<LogTime>,
    /// The last scan in the map that was sent.
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
            map: DrawnMap::new(parameters),
            transform_map_odometry: Pose2::identity(),
            last_step: None,
            drawn_until: None,
            first_drawn: None,
            sent_until: None,
        }
    }

    /// Takes up a scan that was made at a time.
    pub(super) fn add_scan(&mut self, time: LogTime, scan: ScanBeams) {
        self.first_scan.get_or_insert(time);
        self.waiting.push_back((time, scan));
    }

    /// Takes up a pose in the map. `false` if it is not used, as the map is drawn by odometry already, or as it is late.
    pub(super) fn add_pose(&mut self, time: LogTime, pose: &Pose2) -> bool {
        if self.known == Known::ByOdometry {
            return false;
        }
        self.known = Known::ByPoses;
        self.poses.add(time, position(pose))
    }

    /// Takes up where odometry has the robot. `false` if it is late.
    pub(super) fn add_odometry(&mut self, time: LogTime, pose: &Pose2) -> bool {
        self.odometry.add(time, position(pose))
    }

    /// Whether poses of its own are to be sent, as nobody else has any.
    pub(super) fn is_by_odometry(&self) -> bool {
        self.known == Known::ByOdometry
    }

    /// Where it is in its map when odometry has it at a pose.
    pub(super) fn in_map(&self, odometry: &Pose2) -> Pose2 {
        self.transform_map_odometry * odometry
    }

    /// Begins to match scans along odometry, if poses were waited for long enough or none will come.
    pub(super) fn decide(&mut self, parameters: &ScanMapperParameters, is_end: bool) {
        let (Known::NotYet, Some(first), Some(latest)) = (self.known, self.first_scan, self.odometry.latest_time())
        else {
            return;
        };
        if is_end || latest.seconds_since(first) >= parameters.wait_for_poses {
            self.known = Known::ByOdometry;
        }
    }

    /// Draws the scans for whose beams it is known where the robot was, and at the end of the log those that are left as well. Tells
    /// `fate` of each.
    pub(super) fn draw(&mut self, parameters: &ScanMapperParameters, is_end: bool, mut fate: impl FnMut(Fate)) {
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
            fate(match self.known {
                // The last scan of a log has no pose behind its end.
                _ if !is_due && latest.is_some_and(|latest| latest >= time) => Fate::Used,
                _ if !is_due => Fate::NoPose,
                Known::NotYet => Fate::NoPose,
                Known::ByPoses => self.draw_by_poses(time, &scan, parameters),
                Known::ByOdometry => self.draw_by_odometry(time, &scan, parameters),
            });
        }
    }

    fn draw_by_poses(&mut self, time: LogTime, scan: &ScanBeams, parameters: &ScanMapperParameters) -> Fate {
        let at = |delay: f64| pose_at(&self.poses, time.plus_seconds(delay), parameters);
        // Where the beginning and the end of a scan are known, what lies between is.
        if at(0.0).is_none() || at(scan.duration).is_none() {
            return Fate::NoPose;
        }
        match self.map.draw(scan, at) {
            Ok(()) => {
                self.drawn_until = Some(time);
                Fate::Used
            }
            Err(TooLarge) => Fate::TooLarge,
        }
    }

    fn draw_by_odometry(&mut self, time: LogTime, scan: &ScanBeams, parameters: &ScanMapperParameters) -> Fate {
        let Some(start) = pose_at(&self.odometry, time, parameters) else { return Fate::NoPose };
        let mut fate = Fate::Used;
        if let Some(last) = self.last_step {
            let moved = last.inverse() * start;
            let motion = Motion { way: moved.translation.vector.norm(), turn: moved.rotation.angle().abs() };
            if motion.way < parameters.step && motion.turn < parameters.step_yaw {
                return Fate::Used;
            }
            let guess = self.transform_map_odometry * start;
            // Beams of one scan lie to each other as odometry has it.
            let still = self.without_motion(time, scan, &start, parameters);
            match match_scan(&self.map, &still, &guess, motion, parameters) {
                Some(found) => self.transform_map_odometry = found * start.inverse(),
                None => fate = Fate::NotMatched,
            }
        }
        self.last_step = Some(start);
        let (track, transform) = (&self.odometry, self.transform_map_odometry);
        let at = |delay: f64| Some(transform * pose_at(track, time.plus_seconds(delay), parameters)?);
        match self.map.draw(scan, at) {
            Ok(()) => {
                self.drawn_until = Some(time);
                fate
            }
            Err(TooLarge) => Fate::TooLarge,
        }
    }

    /// The scan as a robot would have made it that stood still at `start`.
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

//! Scans that are added at their poses by odometry, if these are known well enough.

use super::robot::{ScanOutcome, pose_at};
use super::sessions::Sessions;
use super::slam_map::{LossCause, LostWay, SlamMap};
use super::{ScanBeams, ScanMapperParameters};
use crate::shared::geometry::Pose2;
use crate::tags::tag_localizer::PoseTrack;
use gridweave_runtime::message::LogTime;

/// Standard deviations of the motion of a robot in a pause in which nothing shows it, metres and radians.
const UNSEEN_MOTION: [f64; 2] = [0.5, 0.5];
/// Least time without a scan, seconds and in usual intervals between scans, that is a gap.
const LEAST_GAP: f64 = 1.0;
const LEAST_INTERVALS: f64 = 3.0;

/// Times of the scans of a robot whose poses by odometry are known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScanTimes {
    first: Option<LogTime>,
    last: Option<LogTime>,
    intervals: f64,
}

impl ScanTimes {
    /// Seconds without a scan before the next one, if they are a gap.
    pub(super) fn gap(&mut self, time: LogTime) -> Option<f64> {
        let first = *self.first.get_or_insert(time);
        let last = self.last.replace(time)?;
        let (seconds, before) = (time.seconds_since(last), last.seconds_since(first));
        let is_gap = seconds > LEAST_GAP && seconds * self.intervals > LEAST_INTERVALS * before;
        self.intervals += 1.0;
        is_gap.then_some(seconds)
    }
}

/// Adds a scan at its pose by odometry. If that is not known well enough, a new session begins unless the scan shows it.
/// `blind` is the last pause in which nothing shows how the robot moved: its end, and its length in seconds.
pub(super) fn add_along_odometry(
    sessions: &mut Sessions,
    odometry: &PoseTrack,
    placed: &mut ScanTimes,
    blind: Option<(LogTime, f64)>,
    (time, scan): (LogTime, &ScanBeams),
    parameters: &ScanMapperParameters,
) -> ScanOutcome {
    if sessions.current().lost_way().is_some() {
        return ScanOutcome::Used;
    }
    let Some(start) = pose_at(odometry, time, parameters) else { return ScanOutcome::NoPose };
    // The relative poses of the beams of one scan are those of odometry.
    let still =
        || scan.without_motion(|delay| Some(start.inv_mul(&pose_at(odometry, time.plus_seconds(delay), parameters)?)));
    let mut guess = start;
    let gap = placed.gap(time);
    if let Some((deviations, lost)) = unseen_motion(sessions.current(), blind, gap, time, &start) {
        let located = sessions.current().relocate(&start, deviations, &still());
        match located.filter(|located| located.is_sure && located.deviation <= parameters.step) {
            Some(located) => guess = located.pose,
            None => sessions.begin(lost, parameters),
        }
    }
    let slam = sessions.current();
    if !slam.is_due(time, &guess, parameters) {
        return ScanOutcome::Used;
    }
    if slam.add(time, &start, &guess, &still()) { ScanOutcome::Used } else { ScanOutcome::NotMatched }
}

/// The standard deviations of a motion up to a scan that is as uncertain as one that nothing shows, metres and radians; and where the
/// robot has lost its way if the scan does not show it either.
fn unseen_motion(
    slam: &SlamMap,
    blind: Option<(LogTime, f64)>,
    gap: Option<f64>,
    time: LogTime,
    odometry: &Pose2,
) -> Option<([f64; 2], LostWay)> {
    let is_since_last = |end: LogTime| end <= time && slam.last_time().is_some_and(|last| last < end);
    if let Some((end, seconds)) = blind.filter(|(end, _)| is_since_last(*end)) {
        return Some((UNSEEN_MOTION, LostWay { time: end, cause: LossCause::Pause(seconds) }));
    }
    let seconds = gap?;
    let deviations = slam.deviations_after_gap(seconds, odometry);
    let lost = LostWay { time, cause: LossCause::ScanGap { seconds, deviation: deviations[0] } };
    (deviations[0] > UNSEEN_MOTION[0]).then_some((deviations, lost))
}

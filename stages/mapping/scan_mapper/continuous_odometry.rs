//! Odometry that goes on where it was when the base of the robot starts again.

use crate::shared::geometry::Pose2;
use gridweave_runtime::message::LogTime;

/// What a robot moves between two messages at most: metres, and metres per second; radians, and radians per second. No
/// robot in a building is as fast.
const LARGEST_STEP: f64 = 0.5;
const LARGEST_SPEED: f64 = 20.0;
const LARGEST_TURN: f64 = 0.5;
const LARGEST_TURN_RATE: f64 = 15.0;
/// Pause of the messages, seconds, in which a driver may have started again unseen: after it the robot is where it can
/// have driven at twice its largest speed so far, or at this one, metres per second.
const PAUSE: f64 = 1.0;
const USUAL_SPEED: f64 = 1.0;
/// Least time over which a speed is measured, seconds.
const LEAST_TIME: f64 = 0.1;
/// Distance from the origin, metres and radians, at which a driver begins.
const AT_ORIGIN: f64 = 0.05;

/// The odometry of a robot without its leaps. A driver that starts again begins at the origin, while the robot stands
/// where it stood.
#[derive(Clone, Debug, Default)]
pub(super) struct ContinuousOdometry {
    /// Time and pose of the last message.
    last: Option<(LogTime, Pose2)>,
    /// What turns the poses of messages into those of the track.
    transform_track_odometry: Pose2,
    /// Time of the first leap.
    first_leap: Option<LogTime>,
    /// Time and length, seconds, of the last pause after which odometry leapt: nothing shows how the robot moved in it.
    blind_pause: Option<(LogTime, f64)>,
    /// Largest speed so far, metres per second.
    fastest: f64,
    has_moved: bool,
}

impl ContinuousOdometry {
    /// The pose in the track for the next message.
    pub(super) fn follow(&mut self, time: LogTime, pose: &Pose2) -> Pose2 {
        if let Some((before, last)) = self.last {
            let passed = time.seconds_since(before).max(0.0);
            let moved = last.inv_mul(pose);
            let (way, turn) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
            self.has_moved |= way > 0.0 || turn > 0.0;
            let is_at_origin =
                |pose: &Pose2| pose.translation.vector.norm() < AT_ORIGIN && pose.rotation.angle().abs() < AT_ORIGIN;
            let has_paused = passed > PAUSE;
            let starts_again = has_paused && is_at_origin(pose) && last.translation.vector.norm() > LARGEST_STEP;
            let speed = if has_paused { USUAL_SPEED.max(2.0 * self.fastest) } else { LARGEST_SPEED };
            let is_far = way > LARGEST_STEP + speed * passed || turn > LARGEST_TURN + LARGEST_TURN_RATE * passed;
            if !is_far && !starts_again {
                self.fastest = self.fastest.max(way / passed.max(LEAST_TIME));
            } else {
                self.first_leap.get_or_insert(time);
                if has_paused {
                    self.blind_pause = Some((time, passed));
                }
                self.transform_track_odometry = self.transform_track_odometry * last * pose.inverse();
            }
        }
        self.last = Some((time, *pose));
        self.transform_track_odometry * pose
    }

    /// When the odometry leapt for the first time.
    pub(super) fn first_leap(&self) -> Option<LogTime> {
        self.first_leap
    }

    /// Time of the end and length, seconds, of the last pause after which odometry leapt.
    pub(super) fn blind_pause(&self) -> Option<(LogTime, f64)> {
        self.blind_pause
    }

    /// Whether there are messages, and all have the same pose.
    pub(super) fn stands_still(&self) -> bool {
        self.last.is_some() && !self.has_moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    fn at(seconds: f64) -> LogTime {
        LogTime::MIN.plus_seconds(seconds)
    }

    #[test]
    fn a_driver_that_starts_again_does_not_move_the_robot() {
        let mut odometry = ContinuousOdometry::default();
        let drive = |seconds: f64| pose(2.0 + 0.8 * seconds, -1.0, 0.9 * seconds);
        for tick in 0..50 {
            let seconds = 0.1 * f64::from(tick);
            assert_eq!(odometry.follow(at(seconds), &drive(seconds)), drive(seconds));
        }
        assert_eq!(odometry.first_leap(), None);
        // It begins at the origin of its own.
        let start = drive(4.9);
        for tick in 50..100 {
            let seconds = 0.1 * f64::from(tick);
            let found = odometry.follow(at(seconds), &(drive(5.0).inverse() * drive(seconds)));
            let expected = start * drive(5.0).inverse() * drive(seconds);
            let off = found.inv_mul(&expected);
            assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle().abs() < 1e-9, "{seconds}");
        }
        assert_eq!(odometry.first_leap(), Some(at(5.0)));
    }

    #[test]
    fn a_gap_or_a_fast_robot_is_no_leap() {
        let mut odometry = ContinuousOdometry::default();
        odometry.follow(at(0.0), &pose(0.0, 0.0, 0.0));
        odometry.follow(at(60.0), &pose(30.0, 5.0, 3.0));
        odometry.follow(at(60.05), &pose(30.4, 5.0, -3.0));
        assert_eq!(odometry.first_leap(), None);
        assert!(!odometry.stands_still());
    }

    #[test]
    fn a_driver_that_starts_again_in_a_pause_leaps() {
        for start in [pose(0.0, 0.0, 0.0), pose(-30.0, 2.0, 1.0)] {
            let mut odometry = ContinuousOdometry::default();
            for tick in 0..100 {
                let seconds = 0.1 * f64::from(tick);
                odometry.follow(at(seconds), &pose(0.6 * seconds, 0.0, 0.0));
            }
            assert_eq!(odometry.blind_pause(), None);
            let found = odometry.follow(at(21.9), &start);
            assert!((found.translation.x - 0.6 * 9.9).abs() < 1e-9, "the robot is where it was");
            let (end, passed) = odometry.blind_pause().unwrap();
            assert!(end == at(21.9) && (passed - 12.0).abs() < 1e-6);
        }
        // One that has gone on, and one that waits at its start.
        let mut odometry = ContinuousOdometry::default();
        odometry.follow(at(0.0), &pose(0.0, 0.0, 0.0));
        odometry.follow(at(5.0), &pose(0.0, 0.0, 0.0));
        odometry.follow(at(6.0), &pose(0.8, 0.0, 0.0));
        odometry.follow(at(16.0), &pose(14.0, 0.0, 0.0));
        assert_eq!(odometry.first_leap(), None);
    }

    #[test]
    fn odometry_stands_still_if_all_messages_have_one_pose() {
        let mut odometry = ContinuousOdometry::default();
        assert!(!odometry.stands_still(), "there is none");
        for second in 0..5 {
            odometry.follow(at(f64::from(second)), &pose(1.0, 2.0, 0.5));
        }
        assert!(odometry.stands_still());
        odometry.follow(at(6.0), &pose(1.0, 2.001, 0.5));
        assert!(!odometry.stands_still());
    }
}

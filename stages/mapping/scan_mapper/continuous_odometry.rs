//! Odometry that goes on where it was when the base of the robot starts again.

use crate::shared::geometry::Pose2;
use gridweave_runtime::message::LogTime;

/// What a robot moves between two messages at most: metres, and metres per second; radians, and radians per second. No
/// robot in a building is as fast.
const LARGEST_STEP: f64 = 0.5;
const LARGEST_SPEED: f64 = 20.0;
const LARGEST_TURN: f64 = 0.5;
const LARGEST_TURN_RATE: f64 = 15.0;

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
            if way > LARGEST_STEP + LARGEST_SPEED * passed || turn > LARGEST_TURN + LARGEST_TURN_RATE * passed {
                self.first_leap.get_or_insert(time);
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

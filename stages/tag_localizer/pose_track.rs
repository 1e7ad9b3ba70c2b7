//! Where a robot was at a time.

use crate::geometry::{Point2, Pose2};
use gridweave_runtime::message::LogTime;
use std::collections::VecDeque;

/// How long poses are kept for readings that come late, seconds.
const HISTORY: f64 = 10.0;

/// The recent poses of one robot.
#[derive(Clone, Debug, Default)]
pub struct PoseTrack {
    poses: VecDeque<(LogTime, Pose2)>,
}

/// Why there is no position for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPose {
    /// All poses that are kept are later.
    Before,
    /// The last pose before it is too old.
    TooOld,
}

impl PoseTrack {
    /// Adds a pose. `false`, and it is left out, if it is older than the last one.
    pub fn add(&mut self, time: LogTime, pose: Pose2) -> bool {
        if self.latest_time().is_some_and(|latest| time < latest) {
            return false;
        }
        self.poses.push_back((time, pose));
        while self.poses.front().is_some_and(|(first, _)| time.seconds_since(*first) > HISTORY) && self.poses.len() > 2
        {
            self.poses.pop_front();
        }
        true
    }

    /// The time of the last pose.
    pub fn latest_time(&self) -> Option<LogTime> {
        self.poses.back().map(|(time, _)| *time)
    }

    /// The last position.
    pub fn latest_position(&self) -> Option<Point2> {
        self.poses.back().map(|(_, pose)| Point2::from(pose.translation.vector))
    }

    /// The position at `time`: between the poses before and after it, or that of the pose before it, which must not be
    /// older than `max_age` seconds.
    pub fn position(&self, time: LogTime, max_age: f64) -> Result<Point2, NoPose> {
        let next = self.poses.partition_point(|(pose_time, _)| *pose_time <= time);
        let Some((before, pose)) = next.checked_sub(1).and_then(|index| self.poses.get(index)) else {
            return Err(NoPose::Before);
        };
        let age = time.seconds_since(*before);
        if age > max_age {
            return Err(NoPose::TooOld);
        }
        let here = Point2::from(pose.translation.vector);
        Ok(match self.poses.get(next) {
            Some((after, pose)) => {
                let there = Point2::from(pose.translation.vector);
                here + (there - here) * (age / after.seconds_since(*before))
            }
            None => here,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;

    fn at(seconds: f64) -> LogTime {
        LogTime::MIN.plus_seconds(seconds)
    }

    fn track() -> PoseTrack {
        let mut track = PoseTrack::default();
        for (seconds, x) in [(1.0, 0.0), (2.0, 1.0), (5.0, 7.0)] {
            assert!(track.add(at(seconds), pose(x, -x, 0.0)));
        }
        track
    }

    #[test]
    fn a_position_between_two_poses_is_interpolated() {
        assert_eq!(track().position(at(1.0), 0.5), Ok(Point2::new(0.0, 0.0)));
        assert!((track().position(at(1.25), 0.5).unwrap() - Point2::new(0.25, -0.25)).norm() < 1e-9);
        assert!((track().position(at(2.5), 0.5).unwrap() - Point2::new(2.0, -2.0)).norm() < 1e-9);
    }

    #[test]
    fn after_the_last_pose_it_stands_for_a_while() {
        assert_eq!(track().position(at(5.5), 0.5), Ok(Point2::new(7.0, -7.0)));
        assert_eq!(track().position(at(5.6), 0.5), Err(NoPose::TooOld));
        assert_eq!(track().position(at(4.0), 0.5), Err(NoPose::TooOld), "a gap between poses");
    }

    #[test]
    fn before_the_first_pose_there_is_none() {
        assert_eq!(track().position(at(0.9), 0.5), Err(NoPose::Before));
        assert_eq!(PoseTrack::default().position(at(0.9), 0.5), Err(NoPose::Before));
    }

    #[test]
    fn two_poses_of_one_time_leave_the_later_one() {
        let mut track = track();
        assert!(track.add(at(5.0), pose(9.0, 0.0, 0.0)));
        assert_eq!(track.position(at(5.0), 0.5), Ok(Point2::new(9.0, 0.0)));
    }

    #[test]
    fn a_pose_that_comes_late_is_left_out() {
        assert!(!track().add(at(4.9), pose(0.0, 0.0, 0.0)));
    }

    #[test]
    fn old_poses_are_forgotten() {
        let mut track = PoseTrack::default();
        for step in 0..1000 {
            track.add(at(0.1 * f64::from(step)), pose(0.0, 0.0, 0.0));
        }
        assert!(track.poses.len() <= 102, "{}", track.poses.len());
    }
}

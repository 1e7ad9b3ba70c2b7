//! Poses of a robot by time.

use crate::shared::geometry::{Point2, wrap_angle};
use gridweave_runtime::message::LogTime;
use nalgebra::Matrix2;
use std::collections::VecDeque;

/// How long poses are kept for late readings, seconds.
const HISTORY: f64 = 10.0;

/// Pose of a robot with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Position, metres, map frame.
    pub place: Point2,
    /// Covariance of the position, square metres; zeros if it is unknown.
    pub covariance: Matrix2<f64>,
    /// Heading, radians, map frame.
    pub yaw: f64,
    /// Variance of the heading, square radians; 0 if it is unknown.
    pub yaw_variance: f64,
}

impl Position {
    /// A position with nothing else known.
    pub fn new(place: Point2) -> Self {
        Self { place, covariance: Matrix2::zeros(), yaw: 0.0, yaw_variance: 0.0 }
    }

    /// Interpolates from this position to another one, where `share` is 0 to 1.
    ///
    /// The errors of the two are correlated by an unknown amount. The covariances are interpolated as the positions
    /// are, which is right for full correlation; for independent errors it would be less.
    fn towards(&self, other: &Self, share: f64) -> Self {
        Self {
            place: self.place + (other.place - self.place) * share,
            covariance: self.covariance + (other.covariance - self.covariance) * share,
            yaw: self.yaw + wrap_angle(other.yaw - self.yaw) * share,
            yaw_variance: self.yaw_variance + (other.yaw_variance - self.yaw_variance) * share,
        }
    }
}

/// Recent positions of one robot.
#[derive(Clone, Debug, Default)]
pub struct PoseTrack {
    positions: VecDeque<(LogTime, Position)>,
}

/// Why there is no position for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPose {
    /// All stored poses are later.
    Before,
    /// The last pose before it is too old.
    TooOld,
}

impl PoseTrack {
    /// Adds a position. Returns `false`, and ignores it, if it is older than the last one.
    pub fn add(&mut self, time: LogTime, position: Position) -> bool {
        if self.latest_time().is_some_and(|latest| time < latest) {
            return false;
        }
        self.positions.push_back((time, position));
        let is_old = |(first, _): &(LogTime, Position)| time.seconds_since(*first) > HISTORY;
        while self.positions.front().is_some_and(is_old) && self.positions.len() > 2 {
            self.positions.pop_front();
        }
        true
    }

    /// The time of the last pose.
    pub fn latest_time(&self) -> Option<LogTime> {
        self.positions.back().map(|(time, _)| *time)
    }

    /// The last position.
    pub fn latest_place(&self) -> Option<Point2> {
        self.positions.back().map(|(_, position)| position.place)
    }

    /// The position at `time`: interpolated between the poses before and after it, or that of the pose before it,
    /// which must not be older than `max_age` seconds.
    pub fn position(&self, time: LogTime, max_age: f64) -> Result<Position, NoPose> {
        let next = self.positions.partition_point(|(earlier, _)| *earlier <= time);
        let Some((before, here)) = next.checked_sub(1).and_then(|index| self.positions.get(index)) else {
            return Err(NoPose::Before);
        };
        let age = time.seconds_since(*before);
        if age > max_age {
            return Err(NoPose::TooOld);
        }
        Ok(match self.positions.get(next) {
            Some((after, there)) => here.towards(there, age / after.seconds_since(*before)),
            None => *here,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> LogTime {
        LogTime::MIN.plus_seconds(seconds)
    }

    fn position(x: f64, y: f64) -> Position {
        Position::new(Point2::new(x, y))
    }

    fn place(track: &PoseTrack, seconds: f64) -> Result<Point2, NoPose> {
        track.position(at(seconds), 0.5).map(|position| position.place)
    }

    fn track() -> PoseTrack {
        let mut track = PoseTrack::default();
        for (seconds, x) in [(1.0, 0.0), (2.0, 1.0), (5.0, 7.0)] {
            assert!(track.add(at(seconds), position(x, -x)));
        }
        track
    }

    #[test]
    fn a_position_between_two_poses_is_interpolated() {
        assert_eq!(place(&track(), 1.0), Ok(Point2::new(0.0, 0.0)));
        assert!((place(&track(), 1.25).unwrap() - Point2::new(0.25, -0.25)).norm() < 1e-9);
        assert!((place(&track(), 2.5).unwrap() - Point2::new(2.0, -2.0)).norm() < 1e-9);
    }

    #[test]
    fn between_two_poses_the_covariance_goes_from_one_to_the_other() {
        let mut track = PoseTrack::default();
        for (seconds, variance) in [(1.0, 0.01), (2.0, 0.05)] {
            let covariance = Matrix2::new(variance, 0.001, 0.001, 2.0 * variance);
            track.add(at(seconds), Position { covariance, ..position(0.0, 0.0) });
        }
        let between = track.position(at(1.25), 0.5).unwrap().covariance;
        assert!((between - Matrix2::new(0.02, 0.001, 0.001, 0.04)).norm() < 1e-9, "{between}");
    }

    #[test]
    fn between_two_poses_the_heading_turns_the_shorter_way() {
        let mut track = PoseTrack::default();
        for (seconds, yaw) in [(1.0, 3.0), (2.0, -3.0)] {
            track.add(at(seconds), Position { yaw, ..position(0.0, 0.0) });
        }
        let between = track.position(at(1.5), 0.5).unwrap().yaw;
        assert!((between - std::f64::consts::PI).abs() < 1e-9, "{between}");
    }

    #[test]
    fn after_the_last_pose_it_is_valid_for_a_while() {
        assert_eq!(place(&track(), 5.5), Ok(Point2::new(7.0, -7.0)));
        assert_eq!(place(&track(), 5.6), Err(NoPose::TooOld));
        assert_eq!(place(&track(), 4.0), Err(NoPose::TooOld), "a gap between poses");
    }

    #[test]
    fn before_the_first_pose_there_is_none() {
        assert_eq!(place(&track(), 0.9), Err(NoPose::Before));
        assert_eq!(place(&PoseTrack::default(), 0.9), Err(NoPose::Before));
    }

    #[test]
    fn two_poses_of_one_time_leave_the_later_one() {
        let mut track = track();
        assert!(track.add(at(5.0), position(9.0, 0.0)));
        assert_eq!(place(&track, 5.0), Ok(Point2::new(9.0, 0.0)));
    }

    #[test]
    fn a_late_pose_is_ignored() {
        assert!(!track().add(at(4.9), position(0.0, 0.0)));
    }

    #[test]
    fn old_poses_are_forgotten() {
        let mut track = PoseTrack::default();
        for step in 0..1000 {
            track.add(at(0.1 * f64::from(step)), position(0.0, 0.0));
        }
        assert!(track.positions.len() <= 102, "{}", track.positions.len());
    }
}

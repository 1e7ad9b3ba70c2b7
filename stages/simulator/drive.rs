//! Drive of a robot along its path: poses at a fixed rate, with limits of speed, acceleration and turn rate.

use crate::shared::geometry::{Point2, Pose2, pose, wrap_angle};

/// Poses, scans and readings come at 10 Hz.
pub const TICK_SECONDS: f64 = 0.1;
/// Distance of the point on the path that the robot turns towards, metres.
const LOOK_AHEAD: f64 = 0.35;
/// The robot turns on the spot if the path deviates by more than this, radians.
const TURN_ON_THE_SPOT: f64 = 1.0;

/// Limits of a robot's drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DriveLimits {
    /// Metres a second.
    pub(super) speed: f64,
    /// Metres a second squared.
    pub(super) acceleration: f64,
    /// Radians a second.
    pub(super) turn_rate: f64,
    /// The drive ends after this time, seconds.
    pub(super) duration: f64,
}

/// Follows a path; returns a pose (in the frame of the path) every [`TICK_SECONDS`], at least one unless the path is
/// empty.
///
/// The robot stays on the path, turns towards a point a little ahead, slows down in curves and turns on the spot
/// where the path reverses.
pub(super) fn drive(way: &[Point2], limits: &DriveLimits) -> Vec<Pose2> {
    let mut track = Track { way, leg: 0, along: 0.0 };
    let Some(mut place) = track.point(0.0) else { return Vec::new() };
    let mut heading = track.direction_from(&place).unwrap_or(0.0);
    let mut speed = 0.0;
    let mut poses = vec![pose(place.x, place.y, heading)];
    let most = (limits.duration / TICK_SECONDS) as usize;
    while poses.len() < most && !track.is_done() {
        let off = track.direction_from(&place).map_or(0.0, |direction| wrap_angle(direction - heading));
        let most_turn = limits.turn_rate * TICK_SECONDS;
        heading = wrap_angle(heading + (0.5 * off).clamp(-most_turn, most_turn));
        let wanted = if off.abs() > TURN_ON_THE_SPOT { 0.0 } else { limits.speed * off.cos().powi(3) };
        speed = wanted.min(speed + limits.acceleration * TICK_SECONDS);
        track.advance(speed * TICK_SECONDS);
        place = track.point(0.0).unwrap_or(place);
        poses.push(pose(place.x, place.y, heading));
    }
    poses
}

/// A position on a path, as a distance along one of its legs.
struct Track<'a> {
    way: &'a [Point2],
    leg: usize,
    along: f64,
}

impl Track<'_> {
    fn is_done(&self) -> bool {
        self.leg + 1 >= self.way.len()
    }

    fn advance(&mut self, mut distance: f64) {
        while let Some([from, to]) = self.way.get(self.leg..self.leg + 2) {
            let left = (to - from).norm() - self.along;
            if distance < left {
                self.along += distance;
                return;
            }
            distance -= left;
            self.leg += 1;
            self.along = 0.0;
        }
    }

    /// The point `ahead` metres further on the path; its end if the path ends before.
    fn point(&self, ahead: f64) -> Option<Point2> {
        let mut place = Track { way: self.way, leg: self.leg, along: self.along };
        if ahead > 0.0 {
            place.advance(ahead);
        }
        let from = *self.way.get(place.leg).or(self.way.last())?;
        match self.way.get(place.leg + 1) {
            Some(to) if place.along > 0.0 => Some(from + (to - from).normalize() * place.along),
            _ => Some(from),
        }
    }

    fn direction_from(&self, place: &Point2) -> Option<f64> {
        let ahead = self.point(LOOK_AHEAD)? - place;
        (ahead.norm() > 1e-3).then(|| ahead.y.atan2(ahead.x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: DriveLimits = DriveLimits { speed: 0.7, acceleration: 0.6, turn_rate: 1.2, duration: 600.0 };

    fn there_and_back() -> Vec<Point2> {
        let there = (0..40).map(|i| Point2::new(0.1 * f64::from(i), 0.0));
        let back = (0..40).rev().map(|i| Point2::new(0.1 * f64::from(i), 0.02));
        there.chain(back).collect()
    }

    #[test]
    fn no_limit_is_broken_and_the_end_is_reached() {
        let way = there_and_back();
        let poses = drive(&way, &LIMITS);
        for pair in poses.windows(2) {
            let moved = (pair[1].translation.vector - pair[0].translation.vector).norm();
            let turned = wrap_angle(pair[1].rotation.angle() - pair[0].rotation.angle());
            assert!(moved <= 0.07 + 1e-9 && turned.abs() <= 0.12 + 1e-9);
        }
        let end = poses.last().unwrap().translation.vector;
        assert!((end - way.last().unwrap().coords).norm() < 1e-9);
        assert!(poses.iter().any(|pose| pose.rotation.angle().abs() > 3.0), "it has turned round");
    }

    #[test]
    fn a_drive_is_cut_at_its_longest_time() {
        assert_eq!(drive(&there_and_back(), &DriveLimits { duration: 2.0, ..LIMITS }).len(), 20);
    }

    #[test]
    fn ways_of_no_point_one_point_or_equal_points_are_driven() {
        assert!(drive(&[], &LIMITS).is_empty());
        assert_eq!(drive(&[Point2::new(1.0, 2.0)], &LIMITS).len(), 1);
        assert!(!drive(&[Point2::new(1.0, 2.0); 5], &LIMITS).is_empty());
    }
}

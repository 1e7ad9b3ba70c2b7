//! Odometry from the scans alone, for robots that have no other.

use super::slam_map::{LossCause, LostWay, SlamMap};
use super::{ScanBeams, ScanMapperParameters};
use crate::shared::geometry::{Pose2, pose};
use gridweave_runtime::message::LogTime;

/// Standard deviations of the acceleration of a robot, metres and radians per second squared, by which the motion up to
/// a scan differs from that up to the one before. Small robots turn out of a curve on the spot between two scans.
const ACCELERATION: [f64; 2] = [1.0, 5.0];
/// Least standard deviations of the motion between two scans, metres and radians.
const LEAST_DEVIATIONS: [f64; 2] = [0.03, 0.02];
/// Longest time over which a velocity is believed, seconds.
const LONGEST_GAP: f64 = 1.0;

/// Poses of a robot by its scans: each scan is registered on the earlier ones from where the robot would be at the
/// velocity between the last two.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScanOdometry {
    last: Option<(LogTime, Pose2)>,
    /// Time of the last scan whose walls showed where it was made.
    seen: Option<LogTime>,
    /// Metres and radians per second, in the frame of the base.
    velocity: [f64; 3],
}

impl ScanOdometry {
    /// The motion of the base in the seconds after a scan, at the velocity between the last two.
    pub(super) fn motion(&self, seconds: f64) -> Pose2 {
        let [x, y, turn] = self.velocity.map(|velocity| velocity * seconds.min(LONGEST_GAP));
        pose(x, y, turn)
    }

    /// The pose at a scan, in the frame of the first one. The robot has lost its way if the scan lies on no earlier ones
    /// after a pause, or if for as long its walls do not show whether the robot has moved by a step.
    pub(super) fn pose(
        &mut self,
        time: LogTime,
        scan: &ScanBeams,
        slam: &mut SlamMap,
        parameters: &ScanMapperParameters,
    ) -> Pose2 {
        let (Some((before, last)), Some(seen)) = (self.last, self.seen) else {
            (self.last, self.seen) = (Some((time, Pose2::identity())), Some(time));
            return Pose2::identity();
        };
        let gap = time.seconds_since(before).max(0.0);
        let guess = last * self.motion(gap);
        let deviations = [0, 1].map(|axis| LEAST_DEVIATIONS[axis] + ACCELERATION[axis] * gap.min(LONGEST_GAP).powi(2));
        let located = slam.locate(&guess, deviations, scan);
        if gap > LONGEST_GAP && !located.is_some_and(|located| located.is_sure) {
            slam.lose_way(LostWay { time, cause: LossCause::Pause(gap) });
        }
        match located {
            Some(located) if located.deviation <= parameters.step => self.seen = Some(time),
            Some(_) if time.seconds_since(seen) > LONGEST_GAP => {
                slam.lose_way(LostWay { time: seen, cause: LossCause::ParallelWalls });
            }
            _ => {}
        }
        // Where the scan lies on no other one, the robot is taken to go on as it did.
        let found = located.map_or(guess, |located| located.pose);
        if gap > 0.0 {
            let moved = last.inv_mul(&found);
            self.velocity = [moved.translation.x, moved.translation.y, moved.rotation.angle()].map(|by| by / gap);
        }
        self.last = Some((time, found));
        found
    }
}

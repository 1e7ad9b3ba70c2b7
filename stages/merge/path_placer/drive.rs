//! The path of a robot in its own map.

use crate::shared::geometry::Pose2;
use gridweave_runtime::ros::Time;

/// Poses of a robot in its map frame, in the order of their messages, at a least distance from each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    poses: Vec<(Time, Pose2)>,
    /// The latest pose, if it is too near to the last of `poses` to be one of them.
    last: Option<(Time, Pose2)>,
}

impl Drive {
    /// Adds a pose. One less than `spacing` metres from the one before, or that is not finite, is left out, except at
    /// the end of the path.
    pub fn add(&mut self, stamp: Time, pose: Pose2, spacing: f64) {
        if !pose.translation.vector.iter().all(|value| value.is_finite()) || !pose.rotation.angle().is_finite() {
            return;
        }
        let is_near =
            |(_, before): &(Time, Pose2)| (pose.translation.vector - before.translation.vector).norm() < spacing;
        match self.poses.last().is_some_and(is_near) {
            true => self.last = Some((stamp, pose)),
            false => {
                self.poses.push((stamp, pose));
                self.last = None;
            }
        }
    }

    /// The poses with their times, including the latest one.
    pub fn poses(&self) -> impl Iterator<Item = (Time, Pose2)> + '_ {
        self.poses.iter().chain(&self.last).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn a_path_keeps_poses_some_distance_apart_and_its_end() {
        let mut drive = Drive::default();
        let at = |sec| Time { sec, nanosec: 0 };
        for (second, x) in [0.0, 0.04, f64::NAN, 0.12, 0.13, 0.14].into_iter().enumerate() {
            drive.add(at(second as i32), pose(x, 0.0, 0.5), 0.1);
        }
        let kept: Vec<_> = drive.poses().map(|(stamp, pose)| (stamp.sec, pose.translation.x)).collect();
        assert_eq!(kept, [(0, 0.0), (3, 0.12), (5, 0.14)]);
    }
}

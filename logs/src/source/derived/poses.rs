//! Poses and odometry of robots, derived from messages that contain a pose and from transforms.

use super::super::RobotMessages;
use super::super::channel::Route;
use crate::robots::{InferredPoses, NotAPose, PoseSource, PosesInMap, RobotChannels, Role, pose_with_covariance};
use crate::tf::TfPoses;
use gridweave_runtime::ros::{Header, PoseStamped, PoseWithCovarianceStamped, TFMessage, decode};
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use std::collections::BTreeSet;

/// Derives poses with covariance from messages of other types and from transforms.
pub(super) struct DerivedPoses {
    /// Poses from tf, if the pipeline sets `robots.tf`.
    tf: Option<TfPoses>,
    /// Poses of robots without a pose topic.
    inferred: InferredPoses,
    /// Poses on pose topics, in another frame than the map.
    in_map: PosesInMap,
    /// Whether any pose was derived from transforms or odometry.
    has_inferred: bool,
    /// Robots with scans and without maps, whose odometry is sent.
    scanned: BTreeSet<String>,
    /// Whether any odometry for scan matching was sent.
    has_odometry: bool,
}

impl DerivedPoses {
    pub(super) fn new(robots: &RobotTopics, roles: &RobotChannels) -> Self {
        let mut in_map = PosesInMap::default();
        in_map.set_channels(roles);
        Self {
            in_map,
            tf: robots.tf.clone().map(TfPoses::new),
            inferred: InferredPoses::new(roles),
            has_inferred: false,
            scanned: roles.scanned().map(str::to_owned).collect(),
            has_odometry: false,
        }
    }

    /// Replaces the roles. Known frames are kept.
    pub(super) fn set_roles(&mut self, roles: &RobotChannels) {
        self.inferred.set_channels(roles);
        self.in_map.set_channels(roles);
        self.scanned = roles.scanned().map(str::to_owned).collect();
    }

    /// Learns the map frame of a robot without a pose topic.
    pub(super) fn learn_map_frame(&mut self, route: &Route, data: &[u8]) {
        if route.role == Role::Map
            && (self.inferred.asks_for_map(&route.robot) || self.in_map.asks_for_map(&route.robot))
            && let Ok(header) = decode::<Header>(data)
        {
            self.set_map_frame(&route.robot, &header.frame_id);
        }
    }

    /// Sets the frame of a robot's map, unless it is known.
    pub(super) fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if self.inferred.asks_for_map(robot) {
            self.inferred.set_map_frame(robot, frame);
        }
        if self.in_map.asks_for_map(robot) {
            self.in_map.set_map_frame(robot, frame);
        }
    }

    /// Whether any pose is derived from transforms.
    pub(super) fn needs_frames(&self) -> bool {
        self.tf.is_some() || self.inferred.has_robots() || self.in_map.has_robots()
    }

    /// Learns frames from transforms without sending anything.
    pub(super) fn learn_transforms(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        self.poses_of_transforms(prefix, is_static, message);
        self.inferred.odometry(prefix, is_static, message);
    }

    /// Learns where the frames of pose topics are in the frames of maps.
    pub(super) fn learn_pose_frames(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        self.in_map.transforms(prefix, is_static, message);
    }

    /// Sends the poses and the odometry derived from transforms.
    pub(super) fn send_of_transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let (poses, unusable) = self.poses_of_transforms(prefix, is_static, message);
        for _ in 0..unusable {
            output.warn("transforms with values that are not finite, or between a frame and itself");
        }
        for (robot, pose) in poses {
            self.has_inferred = true;
            output.pose.send(&robot, &PoseWithCovarianceStamped::from(pose))?;
        }
        for (robot, pose) in self.inferred.odometry(prefix, is_static, message) {
            self.has_odometry = true;
            output.odometry.send(&robot, &PoseWithCovarianceStamped::from(pose))?;
        }
        Ok(())
    }

    /// Sends the pose in a message of another type.
    pub(super) fn send_pose(
        &mut self,
        route: &mut Route,
        source: PoseSource,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if !output.pose.is_read() {
            return Ok(());
        }
        match pose_with_covariance(source, data) {
            Ok(pose) if route.role == Role::Odometry => {
                let Ok(Header { frame_id, .. }) = decode(&pose) else { return Ok(()) };
                if !self.inferred.takes_odometry(&route.robot, &route.channel.topic, &frame_id) {
                    return Ok(());
                }
                self.has_inferred = true;
                output.pose.send_bytes(&route.robot, &pose)
            }
            Ok(pose) => {
                let in_map = self.in_map.in_map(&route.robot, &pose);
                output.pose.send_bytes(&route.robot, in_map.as_deref().unwrap_or(&pose))
            }
            Err(NotAPose) => {
                route.unreadable += 1;
                output.warn(format!("messages on `{}` could not be read as a pose", route.channel.topic));
                Ok(())
            }
        }
    }

    /// Sends odometry for scan matching.
    pub(super) fn send_odometry(
        &mut self,
        route: &Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if !output.odometry.is_read() || !self.scanned.contains(&route.robot) {
            return Ok(());
        }
        match pose_with_covariance(PoseSource::Odometry, data) {
            Ok(pose) => {
                self.has_odometry = true;
                output.odometry.send_bytes(&route.robot, &pose)
            }
            // The warning is left to the conversion of the pose.
            Err(NotAPose) => Ok(()),
        }
    }

    /// The poses from a message of transforms, and the number of unusable transforms.
    fn poses_of_transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> (Vec<(String, PoseStamped)>, usize) {
        match &mut self.tf {
            Some(tf) => tf.update(prefix, is_static, message),
            None => self.inferred.transforms(prefix, is_static, message),
        }
    }

    /// Whether any pose was derived from transforms or odometry.
    pub(super) fn has_inferred(&self) -> bool {
        self.has_inferred
    }

    /// Whether any odometry for scan matching was sent.
    pub(super) fn has_odometry(&self) -> bool {
        self.has_odometry
    }

    /// Warns of robots whose poses were expected from transforms and never came.
    pub(super) fn warn_of_missing(&self, output: &Output<RobotMessages>) {
        for robot in self.tf.iter().flat_map(TfPoses::robots_without_pose) {
            output.warn(format!("tf has no transform from the base of {robot} to its map"));
        }
        self.inferred.missing().into_values().for_each(|missing| output.warn(missing));
    }
}

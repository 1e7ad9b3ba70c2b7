//! Messages that stages need and no log contains as such: poses from transforms and odometry, scans in the base frame,
//! tag readings from messages of other types, and whole maps from updates.

mod maps;
mod poses;
mod scans;
mod tags;
mod updated_maps;

use super::channel::Route;
use super::{RobotMessages, RobotReading};
use crate::robots::{PoseSource, RobotChannels, Role};
use crate::tf::is_static;
use gridweave_runtime::ros::{TFMessage, decode};
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use maps::DerivedMaps;
use poses::DerivedPoses;
use scans::DerivedScans;
use tags::DerivedTags;

/// Derives messages from those that pass.
pub(super) struct Derived {
    poses: DerivedPoses,
    scans: DerivedScans,
    tags: DerivedTags,
    maps: DerivedMaps,
    /// The base frame in tf, if the pipeline sets it.
    base_frame: Option<String>,
}

impl Derived {
    /// Creates the derivations for channels with these roles. Whole maps are derived from map updates if
    /// `updates_maps`.
    pub(super) fn new(robots: &RobotTopics, roles: &RobotChannels, updates_maps: bool, reading: &RobotReading) -> Self {
        let base_frame = robots.tf.as_ref().map(|tf| tf.base_frame.clone());
        Self {
            poses: DerivedPoses::new(robots, roles),
            scans: DerivedScans::new(base_frame.as_deref(), roles, reading.lidars.clone()),
            tags: DerivedTags::new(base_frame.as_deref(), roles),
            maps: DerivedMaps::new(updates_maps, reading.map_values),
            base_frame,
        }
    }

    /// Replaces the roles. Known frames and maps are kept.
    pub(super) fn set_roles(&mut self, roles: &RobotChannels) {
        self.poses.set_roles(roles);
        self.tags.set_roles(roles);
    }

    /// Tracks the mounting poses of cameras and lidars before any channel with their data is known.
    pub(super) fn expect_sensors(&mut self) {
        self.tags.expect_sensors(self.base_frame.as_deref());
        self.scans.expect_sensors(self.base_frame.as_deref());
    }

    /// Whether anything is derived with frames of tf or of maps.
    pub(super) fn needs_frames(&self) -> bool {
        self.poses.needs_frames() || self.scans.needs_frames() || self.tags.needs_frames()
    }

    /// Learns transforms of the log before they come. Those that are not static show how a lidar is mounted, and where
    /// the frame of poses is in that of the map until the first of them comes; all else in them moves.
    pub(super) fn learn_ahead(&mut self, prefix: &str, is_static: bool, transforms: &TFMessage) {
        self.scans.learn_transforms(prefix, is_static, transforms);
        self.poses.learn_pose_frames(prefix, is_static, transforms);
        if is_static {
            self.poses.learn_transforms(prefix, is_static, transforms);
            self.tags.learn_transforms(prefix, is_static, transforms);
        }
    }

    /// Sets the frame of a robot's map, unless it is known.
    pub(super) fn set_map_frame(&mut self, robot: &str, frame: &str) {
        self.poses.set_map_frame(robot, frame);
    }

    /// Learns frames, maps and map updates from a message before the start.
    pub(super) fn learn(&mut self, route: &Route, roles: &RobotChannels, data: &[u8], output: &Output<RobotMessages>) {
        if route.role == Role::Tf
            && let Ok(transforms) = decode::<TFMessage>(data)
        {
            let (prefix, is_static) = (&route.robot, is_static(&route.channel.topic));
            self.poses.learn_transforms(prefix, is_static, &transforms);
            self.poses.learn_pose_frames(prefix, is_static, &transforms);
            self.tags.learn_transforms(prefix, is_static, &transforms);
            self.scans.learn_transforms(prefix, is_static, &transforms);
        }
        self.poses.learn_map_frame(route, data);
        self.maps.update(route, roles, data, output);
    }

    /// Sends what is derived from a message.
    pub(super) fn send(
        &mut self,
        route: &mut Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        self.send_of_learnt(route, data, output)?;
        self.maps.send_if_due(route, roles, data, output)
    }

    /// Sends what is derived from a message whose map or map update was already [learnt](Self::learn).
    pub(super) fn send_of_learnt(
        &mut self,
        route: &mut Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        self.poses.learn_map_frame(route, data);
        match route.role {
            Role::Pose(source) => self.poses.send_pose(route, source, data, output),
            Role::Odometry => {
                self.poses.send_odometry(route, data, output)?;
                self.poses.send_pose(route, PoseSource::Odometry, data, output)
            }
            Role::Scan => self.scans.send(route, data, output),
            Role::TagMessage => self.tags.send_readings(route, data, output),
            Role::Tf => self.send_of_transforms(route, data, output),
            _ => Ok(()),
        }
    }

    /// Notes the range of a tag on a topic, metres.
    pub(super) fn note_range(&mut self, topic: &str, range: f64, output: &Output<RobotMessages>) {
        self.tags.note_range(topic, range, output);
    }

    /// Sends the maps that were updated since they were last sent.
    pub(super) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.maps.send_updated(output)
    }

    fn send_of_transforms(
        &mut self,
        route: &Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let (positions, bearings) = (output.positions.is_read(), output.bearings.is_read());
        if !output.pose.is_read() && !positions && !bearings && !output.scans.is_read() && !output.odometry.is_read() {
            return Ok(());
        }
        let Ok(message) = decode::<TFMessage>(data) else {
            output.warn(format!("messages on `{}` could not be read as transforms", route.channel.topic));
            return Ok(());
        };
        let (prefix, is_static) = (&route.robot, is_static(&route.channel.topic));
        self.scans.learn_transforms(prefix, is_static, &message);
        self.poses.learn_pose_frames(prefix, is_static, &message);
        self.poses.send_of_transforms(prefix, is_static, &message, output)?;
        self.tags.send_of_transforms(prefix, is_static, &message, output)
    }

    /// Whether any pose was derived from transforms or odometry.
    pub(super) fn has_inferred_poses(&self) -> bool {
        self.poses.has_inferred()
    }

    /// Whether any odometry for scan matching was sent.
    pub(super) fn has_odometry(&self) -> bool {
        self.poses.has_odometry()
    }

    /// Whether any tag reading was derived from other messages.
    pub(super) fn has_made_readings(&self) -> bool {
        self.tags.has_made_readings()
    }

    /// Warns of robots whose poses were expected from transforms and never came.
    pub(super) fn warn_of_missing_poses(&self, output: &Output<RobotMessages>) {
        self.poses.warn_of_missing(output);
    }
}

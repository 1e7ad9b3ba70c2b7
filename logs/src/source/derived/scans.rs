//! Scans of robots without maps, transformed to the base frame.

use super::super::RobotMessages;
use super::super::channel::Route;
use crate::robots::{LidarPoses, RobotChannels, Scans, read_scan};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::TFMessage;
use gridweave_runtime::stage::{Output, StageError};
use std::collections::BTreeMap;

/// Transforms scans to the base frames of their robots.
pub(super) struct DerivedScans {
    /// The mounting poses of lidars; `None` if no robot has, or may get, scans and no map.
    scans: Option<Scans>,
    /// The poses of lidars that the user has set.
    lidars: LidarPoses,
    /// The log time of the first scan from a lidar without a mount, by robot and frame, where the mount may still come.
    unmounted: Option<BTreeMap<(String, String), LogTime>>,
}

/// How long a live source waits for the mount of a lidar, seconds of log time. Late joiners get static
/// transforms at once.
const MOUNT_TIMEOUT: f64 = 5.0;

impl DerivedScans {
    /// Creates the derivation for robots with the base frame `base_frame`, or one of the usual names.
    pub(super) fn new(base_frame: Option<&str>, roles: &RobotChannels, lidars: LidarPoses) -> Self {
        Self { scans: roles.scanned().next().map(|_| Scans::new(base_frame, lidars.clone())), lidars, unmounted: None }
    }

    /// Tracks the mounting poses of lidars before any channel with scans is known, in a live run. A scan may come
    /// before the mount of its lidar, and is left out.
    pub(super) fn expect_sensors(&mut self, base_frame: Option<&str>) {
        self.unmounted.get_or_insert_default();
        self.scans.get_or_insert_with(|| Scans::new(base_frame, self.lidars.clone()));
    }

    /// Whether the mounting poses of lidars are needed.
    pub(super) fn needs_frames(&self) -> bool {
        self.scans.is_some()
    }

    /// Learns the mounting poses of lidars from transforms whose frame names lack `prefix`.
    pub(super) fn learn_transforms(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        if let Some(scans) = &mut self.scans {
            scans.transforms(prefix, is_static, message);
        }
    }

    /// Sends a scan, transformed to the base frame of its robot.
    pub(super) fn send(
        &mut self,
        route: &mut Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(scans) = self.scans.as_ref().filter(|_| output.scans.is_read()) else { return Ok(()) };
        let topic = &route.channel.topic;
        let Ok(scan) = read_scan(&route.channel, data) else {
            route.unreadable += 1;
            output.warn(format!("messages on `{topic}` could not be read as scans"));
            return Ok(());
        };
        let frame = &scan.header().frame_id;
        if !scans.knows_mount(&route.robot, frame) {
            if let Some(unmounted) = &mut self.unmounted {
                let first = *unmounted.entry((route.robot.clone(), frame.clone())).or_insert(output.log_time());
                if output.log_time().seconds_since(first) < MOUNT_TIMEOUT {
                    return Ok(());
                }
            }
            output.warn(format!(
                "tf has no transform from `{frame}`, the frame of `{topic}`, to the base of {}: the lidar is taken to be at \
                 the base and to look ahead. If it does not, log its mount on /tf_static, or give \
                 it: --lidar {0}=X,Y,YAW (`lidars` of the source)",
                route.robot
            ));
        }
        match scans.to_base_frame(&route.robot, scan) {
            Ok(scan) => output.scans.send(&route.robot, &scan),
            Err(fault) => {
                route.unreadable += 1;
                output.warn(format!("a point cloud on `{topic}` was left out: {fault}"));
                Ok(())
            }
        }
    }
}

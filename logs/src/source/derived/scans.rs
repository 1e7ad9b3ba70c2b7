//! Scans of robots that have no map, as seen from the base of the robot.

use super::super::RobotMessages;
use super::super::channel::Route;
use crate::robots::{RobotChannels, Scans, Untied, read_scan};
use crate::tf::is_static;
use gridweave_runtime::ros::TFMessage;
use gridweave_runtime::stage::{Output, StageError};

/// Transforms scans to the bases of their robots.
pub(super) struct DerivedScans {
    /// How lidars are mounted; `None` if no robot has, or will have, scans and no map.
    scans: Option<Scans>,
}

impl DerivedScans {
    /// For robots whose base is called `base_frame`, or as most are.
    pub(super) fn new(base_frame: Option<&str>, roles: &RobotChannels) -> Self {
        Self { scans: roles.scanned().next().map(|_| Scans::new(base_frame)) }
    }

    /// Learns how lidars are mounted before it is known whether there are any.
    pub(super) fn expect_sensors(&mut self, base_frame: Option<&str>) {
        self.scans.get_or_insert_with(|| Scans::new(base_frame));
    }

    /// Learns how lidars are mounted.
    pub(super) fn learn_transforms(&mut self, route: &Route, message: &TFMessage) {
        if let Some(scans) = &mut self.scans {
            scans.transforms(&route.robot, is_static(&route.channel.topic), message);
        }
    }

    /// Sends a scan as seen from the base of its robot.
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
        let frame = scan.header.frame_id.clone();
        match scans.seen_from_base(&route.robot, scan) {
            Ok(scan) => output.scans.send(&route.robot, &scan),
            Err(Untied) => {
                output.warn(format!(
                    "scans on `{topic}` were left out: tf does not tie their frame, `{frame}`, to the base of {}",
                    route.robot
                ));
                Ok(())
            }
        }
    }
}

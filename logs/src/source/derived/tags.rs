//! Ranges, bearings and positions of tags, from messages of other types and from transforms.

use super::super::RobotMessages;
use super::super::channel::Route;
use crate::robots::{RobotChannels, Seen, TagPositions, Untied};
use crate::tf::is_static;
use gridweave_runtime::ros::{Header, TFMessage, TagPosition, TagRange};
use gridweave_runtime::stage::{Output, StageError};
use std::collections::BTreeSet;

/// Makes readings of tags of messages of other types, and of transforms.
pub(super) struct DerivedTags {
    /// Where cameras and other sensors see tags; `None` if there are no such sensors.
    positions: Option<TagPositions>,
    /// Whether readings of tags were made from other messages.
    has_made_readings: bool,
}

impl DerivedTags {
    /// For robots whose base is called `base_frame`, or as most are.
    pub(super) fn new(base_frame: Option<&str>, roles: &RobotChannels) -> Self {
        let positions = roles.sees_tags().then(|| TagPositions::new(base_frame, roles.tags_in_tf().clone()));
        Self { positions, has_made_readings: false }
    }

    /// Takes other channels; frames that are known stay so.
    pub(super) fn set_roles(&mut self, roles: &RobotChannels) {
        if let Some(positions) = &mut self.positions {
            positions.set_robots(roles.tags_in_tf().clone());
        }
    }

    /// Learns how cameras are mounted before it is known whether there are any.
    pub(super) fn expect_sensors(&mut self, base_frame: Option<&str>) {
        self.positions.get_or_insert_with(|| TagPositions::new(base_frame, BTreeSet::new()));
    }

    /// Learns frames from transforms without sending what follows from them.
    pub(super) fn learn_transforms(&mut self, route: &Route, message: &TFMessage) {
        self.seen_in_transforms(route, message);
    }

    /// Sends the positions of tags that follow from transforms.
    pub(super) fn send_of_transforms(
        &mut self,
        route: &Route,
        message: &TFMessage,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        for (robot, position) in self.seen_in_transforms(route, message) {
            self.send_position(&robot, "of an AprilTag", position, output)?;
        }
        Ok(())
    }

    /// Positions of tags from a message of transforms.
    fn seen_in_transforms(&mut self, route: &Route, message: &TFMessage) -> Vec<(String, Result<TagPosition, Untied>)> {
        let Some(positions) = &mut self.positions else { return Vec::new() };
        positions.transforms(&route.robot, is_static(&route.channel.topic), message)
    }

    /// Sends the readings of tags that a message of another type holds.
    pub(super) fn send_readings(
        &mut self,
        route: &Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(reader) = &route.tag_reader else { return Ok(()) };
        let (robot, topic) = (&route.robot, format!("on `{}`", route.channel.topic));
        let message = match reader.read(robot, data) {
            Ok(message) => message,
            Err(why) => {
                output.warn(format!("readings of tags {topic} were left out: {why}"));
                return Ok(());
            }
        };
        for reading in message.readings {
            match reading.seen {
                Seen::Range { range, stddev, rssi } => {
                    self.has_made_readings = true;
                    let header = Header { stamp: message.stamp, frame_id: message.frame_id.clone() };
                    let tag_id = reading.tag_id;
                    output.tags.send(robot, &TagRange { header, tag_id, range, range_stddev: stddev, rssi })?;
                }
                Seen::Bearing { bearing, stddev } => {
                    let Some(positions) = &self.positions else { continue };
                    let (frame, tag_id) = (&message.frame_id, &reading.tag_id);
                    match positions.bearing(robot, tag_id, message.stamp, frame, (bearing, stddev)) {
                        Ok(bearing) => {
                            self.has_made_readings = true;
                            output.bearings.send(robot, &bearing)?;
                        }
                        Err(Untied) => output.warn(format!(
                            "bearings of tags {topic} were left out: tf does not tie their frame, `{frame}`, to the base of {robot}"
                        )),
                    }
                }
                Seen::At(point) => {
                    let Some(positions) = &self.positions else { continue };
                    let frame = &message.frame_id;
                    let position = positions.position(robot, &reading.tag_id, message.stamp, frame, &point);
                    self.send_position(robot, &topic, position, output)?;
                }
            }
        }
        Ok(())
    }

    fn send_position(
        &mut self,
        robot: &str,
        whose: &str,
        position: Result<TagPosition, Untied>,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        match position {
            Ok(position) => {
                self.has_made_readings = true;
                output.positions.send(robot, &position)
            }
            Err(Untied) => {
                output.warn(format!(
                    "positions {whose} that {robot} sees were left out: tf does not tie its camera to the robot's base"
                ));
                Ok(())
            }
        }
    }

    /// Whether readings of tags were made from other messages.
    pub(super) fn has_made_readings(&self) -> bool {
        self.has_made_readings
    }
}

//! Ranges, bearings and positions of tags, derived from messages of other types and from transforms.

use super::super::RobotMessages;
use super::super::channel::Route;
use crate::robots::{Measurement, NoTransform, RobotChannels, TagPositions, TagRanges};
use gridweave_runtime::ros::{Header, TFMessage, TagPosition, TagRange};
use gridweave_runtime::stage::{Output, StageError};
use std::collections::{BTreeMap, BTreeSet};

/// Derives tag readings from messages of other types and from transforms.
pub(super) struct DerivedTags {
    /// The positions of tags relative to robots; `None` if no sensor gives positions or bearings.
    positions: Option<TagPositions>,
    /// Whether any tag reading was derived from other messages.
    has_made_readings: bool,
    /// By topic.
    ranges: BTreeMap<String, TagRanges>,
}

impl DerivedTags {
    /// Creates the derivation for robots with the base frame `base_frame`, or one of the usual names.
    pub(super) fn new(base_frame: Option<&str>, roles: &RobotChannels) -> Self {
        let positions = roles.sees_tags().then(|| TagPositions::new(base_frame, tags_in_tf(roles)));
        Self { positions, has_made_readings: false, ranges: BTreeMap::new() }
    }

    /// Replaces the roles. Known frames are kept.
    pub(super) fn set_roles(&mut self, roles: &RobotChannels) {
        if let Some(positions) = &mut self.positions {
            positions.set_robots(tags_in_tf(roles));
        }
    }

    /// Tracks the mounting poses of cameras before any channel with their detections is known.
    pub(super) fn expect_sensors(&mut self, base_frame: Option<&str>) {
        self.positions.get_or_insert_with(|| TagPositions::new(base_frame, BTreeSet::new()));
    }

    /// Whether the mounting poses of cameras are needed.
    pub(super) fn needs_frames(&self) -> bool {
        self.positions.is_some()
    }

    /// Learns frames from transforms without sending anything.
    pub(super) fn learn_transforms(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        self.positions_of_transforms(prefix, is_static, message);
    }

    /// Sends the tag positions derived from transforms.
    pub(super) fn send_of_transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        for (robot, position) in self.positions_of_transforms(prefix, is_static, message) {
            self.send_position(&robot, "of an AprilTag", position, output)?;
        }
        Ok(())
    }

    /// The tag positions in a message of transforms.
    fn positions_of_transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> Vec<(String, Result<TagPosition, NoTransform>)> {
        let Some(positions) = &mut self.positions else { return Vec::new() };
        positions.transforms(prefix, is_static, message)
    }

    /// Sends the tag readings in a message of another type.
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
                output.warn(format!("tag readings {topic} were dropped: {why}"));
                return Ok(());
            }
        };
        for reading in message.readings {
            match reading.measurement {
                Measurement::Range { range, stddev, rssi } => {
                    self.has_made_readings = true;
                    self.note_range(&route.channel.topic, range, output);
                    let header = Header { stamp: message.stamp, frame_id: message.frame_id.clone() };
                    let tag_id = reading.tag_id;
                    output.tags.send(robot, &TagRange { header, tag_id, range, range_stddev: stddev, rssi })?;
                }
                Measurement::Bearing { bearing, stddev } => {
                    let Some(positions) = &self.positions else { continue };
                    let (frame, tag_id) = (&message.frame_id, &reading.tag_id);
                    match positions.bearing(robot, tag_id, message.stamp, frame, (bearing, stddev)) {
                        Ok(bearing) => {
                            self.has_made_readings = true;
                            output.bearings.send(robot, &bearing)?;
                        }
                        Err(NoTransform) => output.warn(format!(
                            "tag bearings {topic} were dropped: tf has no transform from their frame `{frame}` to the base of {robot}"
                        )),
                    }
                }
                Measurement::Position(point) => {
                    let Some(positions) = &self.positions else { continue };
                    let frame = &message.frame_id;
                    let position = positions.position(robot, &reading.tag_id, message.stamp, frame, &point);
                    self.send_position(robot, &topic, position, output)?;
                }
            }
        }
        Ok(())
    }

    /// Notes the range of a tag on a topic, metres: a warning says so where they are in another unit.
    pub(super) fn note_range(&mut self, topic: &str, range: f64, output: &Output<RobotMessages>) {
        if !self.ranges.contains_key(topic) {
            self.ranges.insert(topic.to_owned(), TagRanges::default());
        }
        if let Some(note) = self.ranges.get_mut(topic).and_then(|ranges| ranges.add(range)) {
            output.warn(format!("tags on `{topic}`: {note}"));
        }
    }

    fn send_position(
        &mut self,
        robot: &str,
        whose: &str,
        position: Result<TagPosition, NoTransform>,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        match position {
            Ok(position) => {
                self.has_made_readings = true;
                output.positions.send(robot, &position)
            }
            Err(NoTransform) => {
                output.warn(format!(
                    "positions {whose} seen by {robot} were dropped: tf has no transform from its camera to the robot's base"
                ));
                Ok(())
            }
        }
    }

    /// Whether any tag reading was derived from other messages.
    pub(super) fn has_made_readings(&self) -> bool {
        self.has_made_readings
    }
}

/// The robots whose tags are frames in tf.
fn tags_in_tf(roles: &RobotChannels) -> BTreeSet<String> {
    roles.tags_in_tf().map(str::to_owned).collect()
}

//! What stages are told that no message of a log says as it is: poses out of transforms and odometry, readings, bearings and
//! positions of tags out of messages of other types, and whole maps out of updates.

use super::RobotMessages;
use super::channel::Route;
use super::updated_maps::{UpdatedMap, UpdatedMaps};
use crate::robots::InferredPoses;
use crate::robots::Seen;
use crate::robots::TagPositions;
use crate::robots::Untied;
use crate::robots::{NoPose, pose_with_covariance};
use crate::robots::{PoseSource, RobotChannels, Role};
use crate::robots::{Scans, read_scan};
use crate::tf::{TfPoses, is_static};
use gridweave_runtime::ros::{
    Header, OccupancyGrid, OccupancyGridUpdate, PoseStamped, PoseWithCovarianceStamped, TFMessage, TagPosition,
    TagRange, decode,
};
use gridweave_runtime::stage::{Output, RobotTopics, StageError};
use std::collections::BTreeSet;

/// Makes these of messages as they pass.
pub(super) struct Derived {
    /// Poses out of tf, if the pipeline says so.
    tf: Option<TfPoses>,
    /// Poses of robots that have no topic for them.
    inferred: InferredPoses,
    /// Whether poses were made from transforms or odometry.
    has_inferred_poses: bool,
    /// What the base of a robot is called in tf, if the pipeline says so.
    base_frame: Option<String>,
    /// Where tags are that cameras see; `None` if there are no such.
    tag_positions: Option<TagPositions>,
    /// Whether readings of tags were made from other messages.
    has_made_readings: bool,
    /// Where lidars are mounted; `None` if nobody has, or will have, scans and no maps.
    scans: Option<Scans>,
    /// The robots with scans and without maps.
    scanned: BTreeSet<String>,
    /// Whether odometry was sent along which scans can be matched.
    has_odometry: bool,
    /// `None` if maps are passed on as they are.
    updated_maps: Option<UpdatedMaps>,
}

impl Derived {
    /// Nothing is known yet. Whole maps are made of updates if `updates_maps`.
    pub(super) fn new(robots: &RobotTopics, roles: &RobotChannels, updates_maps: bool) -> Self {
        let base_frame = robots.tf.as_ref().map(|tf| tf.base_frame.as_str());
        Self {
            tf: robots.tf.clone().map(TfPoses::new),
            inferred: InferredPoses::new(roles),
            has_inferred_poses: false,
            base_frame: base_frame.map(str::to_owned),
            tag_positions: roles.sees_tags().then(|| TagPositions::new(base_frame, roles.tags_in_tf().clone())),
            has_made_readings: false,
            scans: roles.scanned().next().map(|_| Scans::new(base_frame)),
            scanned: roles.scanned().map(str::to_owned).collect(),
            has_odometry: false,
            updated_maps: updates_maps.then(UpdatedMaps::default),
        }
    }

    /// There are other channels from here on. What is known of frames and maps stays.
    pub(super) fn set_roles(&mut self, roles: &RobotChannels) {
        self.inferred.set_channels(roles);
        self.scanned = roles.scanned().map(str::to_owned).collect();
        if let Some(positions) = &mut self.tag_positions {
            positions.set_robots(roles.tags_in_tf().clone());
        }
    }

    /// Learns how cameras and lidars are mounted before it is known whether there are any.
    pub(super) fn expect_sensors(&mut self) {
        let base_frame = self.base_frame.as_deref();
        self.tag_positions.get_or_insert_with(|| TagPositions::new(base_frame, BTreeSet::new()));
        self.scans.get_or_insert_with(|| Scans::new(base_frame));
    }

    /// Learns from a message before the start: frames, and maps with their updates.
    pub(super) fn learn(&mut self, route: &Route, roles: &RobotChannels, data: &[u8], output: &Output<RobotMessages>) {
        if route.role == Role::Tf
            && let Ok(transforms) = decode::<TFMessage>(data)
        {
            self.poses_of_tf(route, &transforms);
            self.odometry_of_tf(route, &transforms);
            self.tags_of_tf(route, &transforms);
            self.mounts_of_tf(route, &transforms);
        }
        self.learn_map_frame(route, data);
        self.update_map(route, roles, data, output);
    }

    /// Sends what a message tells beside what it says.
    pub(super) fn send(
        &mut self,
        route: &mut Route,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        match route.role {
            Role::Pose(source) => self.send_pose(route, source, data, output),
            Role::Odometry => {
                self.send_odometry(route, data, output)?;
                self.send_pose(route, PoseSource::Odometry, data, output)
            }
            Role::Scan => self.send_scan(route, data, output),
            Role::TagMessage => self.send_tag_readings(route, data, output),
            Role::Tf => self.send_of_tf(route, data, output),
            _ => Ok(()),
        }
    }

    /// Takes up the frame of a map whose robot has no topic for poses.
    pub(super) fn learn_map_frame(&mut self, route: &Route, data: &[u8]) {
        if route.role == Role::Map
            && self.inferred.asks_for_map(&route.robot)
            && let Ok(map) = decode::<OccupancyGrid<'_>>(data)
        {
            self.inferred.set_map_frame(&route.robot, &map.header.frame_id);
        }
    }

    /// Keeps a map whose updates follow, or puts an update into it. Whether the robot's map has become due.
    fn update_map(
        &mut self,
        route: &Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> bool {
        let Some(maps) = self.updated_maps.as_mut().filter(|_| output.map.is_read()) else { return false };
        match route.role {
            Role::Map if roles.updates_map(&route.robot) => {
                // One that cannot be read is warned of by those who need it.
                if let Ok(map) = decode(data) {
                    maps.keep(&route.robot, &map);
                }
                false
            }
            Role::MapUpdate => {
                let updated = match decode::<OccupancyGridUpdate<'_>>(data) {
                    Ok(update) => maps.update(&route.robot, &update).map_err(|problem| problem.to_string()),
                    Err(_) => Err("they do not fit their type".to_owned()),
                };
                let left_out = |why| output.warn(format!("updates on `{}` were left out: {why}", route.channel.topic));
                updated.map_err(left_out).is_ok_and(|is_due| is_due)
            }
            _ => false,
        }
    }

    /// The same, and sends the map if it has become due.
    pub(super) fn send_map_if_due(
        &mut self,
        route: &Route,
        roles: &RobotChannels,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        if !self.update_map(route, roles, data, output) {
            return Ok(());
        }
        let map = self.updated_maps.as_mut().and_then(|maps| maps.take(&route.robot));
        map.map_or(Ok(()), |map| send_map(&route.robot, map, output))
    }

    /// Sends the maps of which updates have come since they were last sent.
    pub(super) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let maps = self.updated_maps.iter_mut().flat_map(UpdatedMaps::take_all);
        maps.into_iter().try_for_each(|(robot, map)| send_map(robot, map, output))
    }

    fn send_pose(
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
                self.has_inferred_poses = true;
                output.pose.send_bytes(&route.robot, &pose)
            }
            Ok(pose) => output.pose.send_bytes(&route.robot, &pose),
            Err(NoPose) => {
                route.unreadable += 1;
                output.warn(format!("messages on `{}` could not be read as a pose", route.channel.topic));
                Ok(())
            }
        }
    }

    /// Sends odometry along which scans can be matched.
    fn send_odometry(&mut self, route: &Route, data: &[u8], output: &Output<RobotMessages>) -> Result<(), StageError> {
        if !output.odometry.is_read() || !self.scanned.contains(&route.robot) {
            return Ok(());
        }
        match pose_with_covariance(PoseSource::Odometry, data) {
            Ok(pose) => {
                self.has_odometry = true;
                output.odometry.send_bytes(&route.robot, &pose)
            }
            // It is warned of where the pose is asked for.
            Err(NoPose) => Ok(()),
        }
    }

    /// Sends a scan as the base of its robot sees it.
    fn send_scan(&mut self, route: &mut Route, data: &[u8], output: &Output<RobotMessages>) -> Result<(), StageError> {
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

    fn mounts_of_tf(&mut self, route: &Route, message: &TFMessage) {
        if let Some(scans) = &mut self.scans {
            scans.transforms(&route.robot, is_static(&route.channel.topic), message);
        }
    }

    /// Sends the poses and the positions of tags that transforms tell.
    fn send_of_tf(&mut self, route: &Route, data: &[u8], output: &Output<RobotMessages>) -> Result<(), StageError> {
        let (positions, bearings) = (output.positions.is_read(), output.bearings.is_read());
        if !output.pose.is_read() && !positions && !bearings && !output.scans.is_read() && !output.odometry.is_read() {
            return Ok(());
        }
        let Ok(message) = decode::<TFMessage>(data) else {
            output.warn(format!("messages on `{}` could not be read as transforms", route.channel.topic));
            return Ok(());
        };
        self.mounts_of_tf(route, &message);
        let (poses, unusable) = self.poses_of_tf(route, &message);
        for _ in 0..unusable {
            output.warn("transforms with values that are not finite, or between a frame and itself");
        }
        for (robot, pose) in poses {
            self.has_inferred_poses = true;
            output.pose.send(&robot, &PoseWithCovarianceStamped::from(pose))?;
        }
        for (robot, pose) in self.odometry_of_tf(route, &message) {
            self.has_odometry = true;
            output.odometry.send(&robot, &PoseWithCovarianceStamped::from(pose))?;
        }
        for (robot, position) in self.tags_of_tf(route, &message) {
            self.send_position(&robot, "of an AprilTag", position, output)?;
        }
        Ok(())
    }

    /// The poses that a message of transforms tells, and how many of these cannot be used.
    fn poses_of_tf(&mut self, route: &Route, message: &TFMessage) -> (Vec<(String, PoseStamped)>, usize) {
        let Route { robot, channel, .. } = route;
        match &mut self.tf {
            Some(tf) => tf.update(robot, is_static(&channel.topic), message),
            None => self.inferred.transforms(robot, is_static(&channel.topic), message),
        }
    }

    /// Where robots with scans are by odometry that a message of transforms tells.
    fn odometry_of_tf(&mut self, route: &Route, message: &TFMessage) -> Vec<(String, PoseStamped)> {
        self.inferred.odometry(&route.robot, is_static(&route.channel.topic), message)
    }

    /// The tags that are seen in a message of transforms.
    fn tags_of_tf(&mut self, route: &Route, message: &TFMessage) -> Vec<(String, Result<TagPosition, Untied>)> {
        let Some(positions) = &mut self.tag_positions else { return Vec::new() };
        positions.transforms(&route.robot, is_static(&route.channel.topic), message)
    }

    /// Sends the readings of tags that a message of another type holds.
    fn send_tag_readings(
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
                    let Some(positions) = &self.tag_positions else { continue };
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
                    let Some(positions) = &self.tag_positions else { continue };
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

    /// Whether poses were made from transforms or odometry.
    pub(super) fn has_inferred_poses(&self) -> bool {
        self.has_inferred_poses
    }

    /// Whether odometry was sent along which scans can be matched.
    pub(super) fn has_odometry(&self) -> bool {
        self.has_odometry
    }

    /// Whether readings of tags were made from other messages.
    pub(super) fn has_made_readings(&self) -> bool {
        self.has_made_readings
    }

    /// Warns of robots whose poses transforms were to tell, and do not.
    pub(super) fn warn_of_missing_poses(&self, output: &Output<RobotMessages>) {
        for robot in self.tf.iter().flat_map(TfPoses::robots_without_pose) {
            output.warn(format!("tf does not tie the base of {robot} to its map"));
        }
        self.inferred.missing().into_values().for_each(|missing| output.warn(missing));
    }
}

fn send_map(robot: &str, map: &UpdatedMap, output: &Output<RobotMessages>) -> Result<(), StageError> {
    output.map.send_grid(robot, &map.prefix, |blank| blank.copy_from(&map.cells))
}

//! Poses of robots without a pose topic: from tf, or from odometry in the map frame, or in any where a robot has no
//! map.

use super::channels::RobotChannels;
use super::mounts::BASES;
use crate::tf::{PoseFrames, TfPoses};
use gridweave_runtime::ros::{PoseStamped, TFMessage};
use std::collections::{BTreeMap, BTreeSet};

/// Frame of a robot's odometry, without the robot's name.
const ODOMETRY_FRAME: &str = "odom";

/// The source of the poses of a robot without a pose topic.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Origin {
    /// tf connects this base frame to the robot's map frame.
    Tf(String),
    /// The odometry on this topic is in the map frame.
    Odometry(String),
}

/// Finds the poses of robots without a pose topic.
///
/// The first source that gives a pose of a robot, tf or odometry, is used for all its poses.
#[derive(Debug, Default)]
pub(crate) struct InferredPoses {
    tf: TfPoses,
    /// Poses from tf in the odometry frame, of robots with scans and without an odometry topic.
    odometry: TfPoses,
    /// Robots whose odometry pose was found in tf.
    with_odometry: BTreeSet<String>,
    origins: BTreeMap<String, Origin>,
    /// Robots whose map was received, so that its frame is known.
    mapped: BTreeSet<String>,
    /// Robots without maps and scans: where tf has no map frame of theirs, that of their odometry is as good.
    mapless: BTreeSet<String>,
    /// Odometry in a frame other than the map frame: topic and frame, by robot.
    elsewhere: BTreeMap<String, (String, String)>,
}

impl InferredPoses {
    /// Creates a finder for the robots without a pose topic.
    pub(crate) fn new(channels: &RobotChannels) -> Self {
        let mut poses = Self::default();
        poses.set_channels(channels);
        poses
    }

    /// Replaces the set of robots without a pose topic. Known frames are kept.
    pub(crate) fn set_channels(&mut self, channels: &RobotChannels) {
        let ends = |robot: &str| PoseFrames {
            map: format!("{robot}/map"),
            bases: BASES.map(|base| format!("{robot}{base}")).to_vec(),
        };
        self.tf.set_robots(channels.unposed().map(|robot| (robot.to_owned(), ends(robot))).collect());
        let with_map: BTreeSet<&str> = channels.mapped().chain(channels.scanned()).collect();
        self.mapless = channels.unposed().filter(|robot| !with_map.contains(robot)).map(str::to_owned).collect();
        let unposed: BTreeSet<&str> = channels.unposed().collect();
        let by_tf = channels.scanned().filter(|robot| unposed.contains(robot));
        let by_tf = by_tf.filter(|robot| !channels.has_odometry(robot));
        let in_odometry = |robot: &str| PoseFrames { map: format!("{robot}/{ODOMETRY_FRAME}"), ..ends(robot) };
        self.odometry.set_robots(by_tf.map(|robot| (robot.to_owned(), in_odometry(robot))).collect());
    }

    /// Poses in the odometry frame, of robots with scans and without an odometry topic, from a message of transforms.
    pub(crate) fn odometry(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> Vec<(String, PoseStamped)> {
        let (poses, _) = self.odometry.update(prefix, is_static, message);
        self.with_odometry.extend(poses.iter().map(|(robot, _)| robot.clone()));
        poses
    }

    /// The source of a robot's odometry, such as "tf (robot1/odom to robot1/base_link)"; `None` if tf has none.
    pub(crate) fn odometry_origin(&self, robot: &str) -> Option<String> {
        let base = self.odometry.base_of(robot).filter(|_| self.with_odometry.contains(robot))?;
        Some(format!("tf ({} to {base})", self.odometry.map_frame(robot)?))
    }

    /// Whether there are robots without a pose topic.
    pub(crate) fn has_robots(&self) -> bool {
        self.tf.robots().next().is_some()
    }

    /// Whether the frame of a robot's map is needed and not known.
    pub(crate) fn asks_for_map(&self, robot: &str) -> bool {
        self.tf.knows(robot) && !self.mapped.contains(robot)
    }

    /// Sets the frame of a robot's map. The default is `ROBOT/map`.
    pub(crate) fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if !frame.is_empty() {
            self.tf.set_map_frame(robot, frame);
            self.mapped.insert(robot.to_owned());
        }
    }

    /// Poses from a message of transforms, by robot, and the number of unusable transforms; see [`TfPoses::update`].
    pub(crate) fn transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> (Vec<(String, PoseStamped)>, usize) {
        let (mut poses, unusable) = self.tf.update(prefix, is_static, message);
        poses.retain(|(robot, _)| {
            let base = || self.tf.base_of(robot).unwrap_or_default().to_owned();
            let origin = self.origins.entry(robot.clone()).or_insert_with(|| Origin::Tf(base()));
            matches!(origin, Origin::Tf(_))
        });
        (poses, unusable)
    }

    /// Whether the odometry of a robot, in the frame `frame`, gives its poses.
    pub(crate) fn takes_odometry(&mut self, robot: &str, topic: &str, frame: &str) -> bool {
        if self.mapless.contains(robot) && !self.origins.contains_key(robot) && !self.tf.has_map_frame(robot) {
            self.set_map_frame(robot, frame);
        }
        if self.tf.map_frame(robot) != Some(frame) {
            let elsewhere = || (topic.to_owned(), frame.to_owned());
            self.elsewhere.entry(robot.to_owned()).or_insert_with(elsewhere);
            return false;
        }
        let origin = match self.origins.get(robot) {
            Some(origin) => origin,
            None => self.origins.entry(robot.to_owned()).or_insert(Origin::Odometry(topic.to_owned())),
        };
        matches!(origin, Origin::Odometry(of) if of == topic)
    }

    /// The source of a robot's poses, such as "tf (robot1/map to robot1/base_link)"; `None` if it has no poses.
    pub(crate) fn origin(&self, robot: &str) -> Option<String> {
        Some(match self.origins.get(robot)? {
            Origin::Tf(base) => format!("tf ({} to {base})", self.tf.map_frame(robot)?),
            Origin::Odometry(topic) => topic.clone(),
        })
    }

    /// Robots that have transforms or odometry and still no pose, each with the reason.
    pub(crate) fn missing(&self) -> BTreeMap<String, String> {
        let missing = |robot: &str| {
            let map = self.tf.map_frame(robot)?;
            let tf = self.tf.has_frames().then(|| {
                format!(
                    "tf has no transform from `{robot}/base_link` or `{robot}/base_footprint` to the map frame `{map}`"
                )
            });
            let odometry = self
                .elsewhere
                .get(robot)
                .map(|(topic, frame)| format!("`{topic}` is in the frame `{frame}`, not in the map frame `{map}`"));
            let why: Vec<String> = tf.into_iter().chain(odometry).collect();
            let text = || format!("no pose of {robot} in its map: {}", why.join(", and "));
            (!why.is_empty()).then(|| (robot.to_owned(), text()))
        };
        let robots = self.tf.robots().filter(|robot| !self.origins.contains_key(*robot));
        robots.filter_map(missing).collect()
    }
}

//! Poses of robots that have no topic for them: out of tf, or odometry that is in the frame of the map.

use super::channels::RobotChannels;
use super::mounts::BASES;
use crate::tf::{Ends, TfPoses};
use gridweave_runtime::ros::{PoseStamped, TFMessage};
use std::collections::{BTreeMap, BTreeSet};

/// What the frame of a robot's odometry is called, behind the robot's name.
const ODOMETRY_FRAME: &str = "odom";

/// Where the poses of a robot come from that has no topic for them.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Origin {
    /// tf ties this frame of its base to its map.
    Tf(String),
    /// Odometry on this topic.
    Odometry(String),
}

/// Finds the poses of robots that have no topic for them.
///
/// What gives a pose of a robot first, tf or odometry, gives all of them.
#[derive(Debug, Default)]
pub(crate) struct InferredPoses {
    tf: TfPoses,
    /// Where the bases of robots that have scans, and no odometry on a topic, are by tf in the frame of odometry.
    odometry: TfPoses,
    /// The robots of which tf has told that.
    with_odometry: BTreeSet<String>,
    origins: BTreeMap<String, Origin>,
    /// The robots whose map was seen, so that its frame is known.
    mapped: BTreeSet<String>,
    /// Where odometry is in another frame than the map: the topic and the frame, by robot.
    elsewhere: BTreeMap<String, (String, String)>,
}

impl InferredPoses {
    /// For the robots that have no topic for poses.
    pub(crate) fn new(channels: &RobotChannels) -> Self {
        let mut poses = Self::default();
        poses.set_channels(channels);
        poses
    }

    /// Looks for the poses of the robots that have no topic for them now. What is known of frames stays.
    pub(crate) fn set_channels(&mut self, channels: &RobotChannels) {
        let ends = |robot: &str| Ends {
            map: format!("{robot}/map"),
            bases: BASES.map(|base| format!("{robot}{base}")).to_vec(),
        };
        self.tf.set_robots(channels.unposed().map(|robot| (robot.to_owned(), ends(robot))).collect());
        let by_tf = channels.scanned().filter(|robot| channels.unposed().any(|unposed| unposed == *robot));
        let by_tf = by_tf.filter(|robot| !channels.has_odometry(robot));
        let in_odometry = |robot: &str| Ends { map: format!("{robot}/{ODOMETRY_FRAME}"), ..ends(robot) };
        self.odometry.set_robots(by_tf.map(|robot| (robot.to_owned(), in_odometry(robot))).collect());
    }

    /// Where robots with scans are in the frames of their odometry, by a message of transforms: for those that have no topic for it.
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

    /// Where the odometry of a robot comes from, as in "tf (robot1/odom to robot1/base_link)"; `None` if tf has told none.
    pub(crate) fn odometry_origin(&self, robot: &str) -> Option<String> {
        let base = self.odometry.base_of(robot).filter(|_| self.with_odometry.contains(robot))?;
        Some(format!("tf ({} to {base})", self.odometry.map_frame(robot)?))
    }

    /// Whether the frame of a robot's map is asked for and not known.
    pub(crate) fn asks_for_map(&self, robot: &str) -> bool {
        self.tf.knows(robot) && !self.mapped.contains(robot)
    }

    /// Takes up the frame of a robot's map. Until then it is taken for `ROBOT/map`.
    pub(crate) fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if !frame.is_empty() {
            self.tf.set_map_frame(robot, frame);
            self.mapped.insert(robot.to_owned());
        }
    }

    /// The poses that transforms tell, by robot, and how many of these could not be used; see [`TfPoses::update`].
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

    /// Whether odometry of a robot, which is in `frame`, gives its poses.
    pub(crate) fn takes_odometry(&mut self, robot: &str, topic: &str, frame: &str) -> bool {
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

    /// Where the poses of a robot come from, as in "tf (robot1/map to robot1/base_link)"; `None` if there are none.
    pub(crate) fn origin(&self, robot: &str) -> Option<String> {
        Some(match self.origins.get(robot)? {
            Origin::Tf(base) => format!("tf ({} to {base})", self.tf.map_frame(robot)?),
            Origin::Odometry(topic) => topic.clone(),
        })
    }

    /// The robots without any pose for which there are transforms or odometry, and why these give none.
    pub(crate) fn missing(&self) -> BTreeMap<String, String> {
        let missing = |robot: &str| {
            let map = self.tf.map_frame(robot)?;
            let tf = self.tf.has_frames().then(|| {
                format!("tf does not tie `{robot}/base_link` or `{robot}/base_footprint` to the map, `{map}`")
            });
            let odometry = self.elsewhere.get(robot).map(|(topic, frame)| {
                format!("`{topic}` is in the frame `{frame}`, which is not that of the map, `{map}`")
            });
            let why: Vec<String> = tf.into_iter().chain(odometry).collect();
            let text = || format!("there is no pose of {robot} in its map: {}", why.join(", and "));
            (!why.is_empty()).then(|| (robot.to_owned(), text()))
        };
        let robots = self.tf.robots().filter(|robot| !self.origins.contains_key(*robot));
        robots.filter_map(missing).collect()
    }
}

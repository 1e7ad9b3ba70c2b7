//! Robots that localise in one map: the map of a map server, which is no robot's, and poses of robots in its frame.
//!
//! Such robots have one map and one frame already. Only what a log names says so: several robots have poses in the
//! frame of the map, or are connected to it by tf, and none of them has a map of its own.

use crate::names::Names;
use crate::reader::{ChannelPart, LogFile, LogReader};
use crate::robot_name::fits;
use crate::robots::{RobotChannels, Role, is_scan};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, TFMessage, decode};
use gridweave_runtime::stage::RobotTopics;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The number of messages of transforms in which robots are looked for.
const SEARCHED: usize = 2_000;
/// The fewest robots that share a map.
const LEAST_ROBOTS: usize = 2;
/// The last part of the names of frames by which a localizer connects a robot to the map.
const ROBOT_FRAMES: [&str; 3] = [ODOM, "base_link", "base_footprint"];
const ODOM: &str = "odom";

/// A map that is no robot's, and the robots that localise in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OneMap {
    /// The topic of the map.
    pub(crate) topic: String,
    /// Its frame, as logged.
    pub(crate) frame: String,
    /// The robots without a map of their own that localise in it, by name: two at the least.
    pub(crate) robots: BTreeSet<String>,
    /// Those of them that have neither scans nor tag readings, so that a merge has nothing of them.
    pub(crate) idle: BTreeSet<String>,
}

/// The data of a channel that are looked at.
enum Shown {
    /// The frame of the map.
    Map,
    /// The frame of the poses of a robot.
    Pose(String),
    /// Transforms, whose frames lack this robot's name; that of none if it is empty.
    Transforms(String),
}

impl OneMap {
    /// Finds the robots of logs that localise in one map. Of channels with poses only the beginning is read, and only
    /// if there is a map of no robot.
    pub(crate) fn read(files: &Arc<[LogFile]>, names: &Names, robots: &RobotTopics) -> Option<Self> {
        let topic = robots.map.replace("/{robot}", "");
        let is_map = |channel: &Channel| channel.topic == topic && is_grid(channel);
        if topic == robots.map || !names.channels().any(is_map) {
            return None;
        }
        let roles = RobotChannels::new(robots.clone(), names.channels());
        let mut shown = BTreeMap::new();
        for (file, log) in files.iter().enumerate() {
            for (number, logged) in log.channels() {
                let Some(channel) = names.channel(file, number).filter(|_| names.wants(file, number)) else { continue };
                let classified = roles.classify(channel);
                let what = match classified.role {
                    Role::Other if is_map(channel) => Shown::Map,
                    Role::Pose(_) => Shown::Pose(classified.robot.to_owned()),
                    // All transforms are named `/tf`.
                    _ => match tf_topic(&logged) {
                        Some(robot) => Shown::Transforms(names.robot_of_file(file).unwrap_or(robot).to_owned()),
                        None => continue,
                    },
                };
                shown.insert((file, number), what);
            }
        }
        let mut reader = LogReader::of(Arc::clone(files));
        reader.limit_to(|file, number| match shown.get(&(file, number))? {
            Shown::Map | Shown::Pose(_) => Some(ChannelPart::Beginning),
            Shown::Transforms(_) => Some(ChannelPart::Whole),
        });
        let (mut frame, mut read) = (None, 0);
        let mut posed: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let mut certain = BTreeSet::new();
        while read < SEARCHED
            && let Some(message) = reader.next_message()
        {
            match shown.get(&(message.file, message.channel)) {
                Some(Shown::Map) => frame = frame.or_else(|| frame_of(message.data)),
                Some(Shown::Pose(robot)) => {
                    certain.insert(robot.clone());
                    posed.entry(robot.clone()).or_default().extend(frame_of(message.data));
                }
                Some(Shown::Transforms(robot)) => {
                    read += 1;
                    let transforms = decode::<TFMessage>(message.data).map(|message| message.transforms);
                    for edge in transforms.unwrap_or_default() {
                        let child = plain(&edge.child_frame_id);
                        let Some((robot, is_certain)) = robot_of_frame(robot, child, names) else { continue };
                        if is_certain || !child.ends_with(ODOM) {
                            certain.insert(robot.clone());
                        }
                        posed.entry(robot).or_default().insert(plain(&edge.header.frame_id).to_owned());
                    }
                }
                _ => {}
            }
        }
        posed.retain(|robot, _| certain.contains(robot));
        Self::of(topic, frame?, &posed, &roles, names)
    }

    /// The robots that localise in the map on `topic` in `frame`; `posed` are the frames of the poses of each robot.
    fn of(
        topic: String,
        frame: String,
        posed: &BTreeMap<String, BTreeSet<String>>,
        roles: &RobotChannels,
        names: &Names,
    ) -> Option<Self> {
        // Also where its name is elsewhere in the topic: such a map or scan is used once it is renamed.
        let has = |robot: &str, is_meant: fn(&Channel) -> bool| {
            let is_own = |channel: &Channel| channel.topic.contains(robot) && !channel.topic.contains("costmap");
            names.channels().any(|channel| is_meant(channel) && channel.topic != topic && is_own(channel))
        };
        let has_grid = |robot: &str| has(robot, is_grid);
        let in_map = posed.iter().filter(|(robot, frames)| frames.contains(&frame) && fits(robot) && !has_grid(robot));
        let robots: BTreeSet<String> = in_map.map(|(robot, _)| robot.clone()).collect();
        let mut busy: BTreeSet<&str> = roles.tags_in_tf().chain(roles.scanned()).collect();
        for channel in names.channels() {
            let classified = roles.classify(channel);
            if matches!(classified.role, Role::Tags | Role::TagMessage | Role::Scan | Role::MapUpdate) {
                busy.insert(classified.robot);
            }
        }
        let has_scans = |robot: &str| has(robot, |channel| is_scan(&full_type_name(&channel.schema_name)));
        let is_idle = |robot: &&String| !busy.contains(robot.as_str()) && !has_scans(robot);
        let idle = robots.iter().filter(is_idle).cloned().collect();
        (robots.len() >= LEAST_ROBOTS).then_some(Self { topic, frame, robots, idle })
    }

    /// The finding in a sentence without its end.
    pub(crate) fn sentence(&self) -> String {
        let robots = list_in_words(&self.robots);
        format!("{robots} localise in one map, `{}`, in frame `{}`", self.topic, self.frame)
    }

    /// Why nothing of these robots is merged, and which maps would be; `pattern` is the topic of robots' maps.
    pub(crate) fn reason(&self, pattern: &str) -> String {
        let sentence = self.sentence();
        format!("{sentence}: there is nothing to merge. Maps that they build themselves are read from `{pattern}`")
    }

    /// The note about robots that a merge uses nevertheless; `None` if there are none.
    pub(crate) fn note(&self) -> Option<String> {
        (self.idle != self.robots).then(|| format!("{}, and have one frame without a merge", self.sentence()))
    }
}

fn is_grid(channel: &Channel) -> bool {
    full_type_name(&channel.schema_name) == OccupancyGrid::NAME
}

/// The frame in the header of a message, if it has one.
fn frame_of(message: &[u8]) -> Option<String> {
    let header = decode::<Header>(message).ok()?;
    Some(plain(&header.frame_id).to_owned()).filter(|frame| !frame.is_empty())
}

/// A frame without the slash that ROS 1 programs put before it.
fn plain(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

/// The robot of a frame by which a localizer connects it to a map, and whether it is certain: `robot1/odom`, or `odom` on
/// the transforms of `robot1`; or `robot1_odom` of a robot that has a topic. Of a robot without one there must be a
/// `robot1_base_link`, too, since there may be several kinds of odometry.
fn robot_of_frame(robot: &str, frame: &str, names: &Names) -> Option<(String, bool)> {
    let (named, last) = frame.rsplit_once('/').unwrap_or((robot, frame));
    if ROBOT_FRAMES.contains(&last) {
        return Some((named.to_owned(), true)).filter(|(named, _)| !named.is_empty());
    }
    let named = ROBOT_FRAMES.iter().find_map(|name| frame.strip_suffix(name)?.strip_suffix('_'))?;
    let under = format!("/{named}/");
    Some((named.to_owned(), names.channels().any(|channel| channel.topic.starts_with(&under))))
}

//! The robot of maps on a topic without a name, `/map`, whose frame has one: `robot1/map`.

use super::first_frames::FirstFrames;
use super::lidars_of_one::NumberedChannel;
use super::rename_advice::PROGRAMS;
use crate::robots::{RobotChannels, Role, is_merger};
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;

/// The name of a robot's map frame, behind its own.
const MAP: &str = "/map";
/// The last part of the names of frames that only a robot has.
const BODIES: [&str; 3] = ["/odom", "/base_link", "/base_footprint"];
/// What is no robot's name before `/map`.
const WORLDS: [&str; 3] = ["world", "earth", "global"];

/// What the frame of the maps on a topic without a robot's name shows.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum MapOwner {
    /// The maps are this robot's, and the topics of the log name no robot.
    Log(String),
    /// The maps are this robot's, beside other robots.
    Robot(String),
    /// The maps are those of several robots, in these frames.
    Several(BTreeSet<String>),
}

/// The topic of maps without the name of a robot; `None` if the pipeline has none.
pub(super) fn nameless_map(robots: &RobotTopics) -> Option<String> {
    let topic = robots.map.replace("/{robot}", "");
    (topic != robots.map).then_some(topic)
}

/// Whether a channel has maps on `topic`.
pub(super) fn is_map_on(channel: &Channel, topic: &str) -> bool {
    channel.topic == topic && full_type_name(&channel.schema_name) == OccupancyGrid::NAME
}

/// Whose the maps on `topic` are. `None` if their frame shows no robot, if the robot has maps on a topic of its own, or
/// if other robots localise in them.
pub(super) fn owner(
    channels: &[NumberedChannel<'_>],
    topic: &str,
    roles: &RobotChannels,
    frames: &FirstFrames,
) -> Option<MapOwner> {
    let maps = channels.iter().filter(|(_, channel)| is_map_on(channel, topic));
    let of_maps: BTreeSet<&str> = maps.flat_map(|(number, _)| frames.of(*number)).collect();
    let robots: BTreeSet<&str> = of_maps.iter().filter_map(|frame| robot_of_map(frame)).collect();
    if robots.len() > 1 && robots.len() == of_maps.len() {
        return Some(MapOwner::Several(of_maps.iter().map(|frame| (*frame).to_owned()).collect()));
    }
    let robot = robots.first().filter(|_| of_maps.len() == 1).copied()?;
    let (mut named, mut with_maps) = (BTreeSet::new(), BTreeSet::new());
    for (number, channel) in channels {
        let classified = roles.classify(channel);
        if matches!(classified.role, Role::Other | Role::Tf) {
            continue;
        }
        named.insert(classified.robot);
        if matches!(classified.role, Role::Map) {
            with_maps.insert(classified.robot);
        }
        let is_posed_in_it = classified.role != Role::Map && frames.of(*number).any(|frame| of_maps.contains(frame));
        if is_posed_in_it && classified.robot != robot {
            return None;
        }
    }
    let is_of_another = |(parent, child): (&str, &str)| {
        of_maps.contains(parent) && robot_of_body(child).is_some_and(|other| other != robot)
    };
    if with_maps.contains(robot) || frames.edges().any(is_of_another) {
        return None;
    }
    let under = format!("/{robot}/");
    let has_body = channels.iter().any(|(_, channel)| channel.topic.starts_with(&under))
        || frames.edges().any(|(_, child)| robot_of_body(child) == Some(robot));
    match (named.is_empty(), with_maps.len()) {
        (true, _) => Some(MapOwner::Log(robot.to_owned())),
        // Beside the maps of two robots there may be one that a program made of them.
        (false, 0 | 1) => Some(MapOwner::Robot(robot.to_owned())),
        (false, _) => has_body.then(|| MapOwner::Robot(robot.to_owned())),
    }
}

/// The robot in the name of a map frame.
fn robot_of_map(frame: &str) -> Option<&str> {
    let robot = frame.strip_suffix(MAP)?;
    let is_robot = !robot.is_empty() && !robot.contains('/') && !PROGRAMS.contains(&robot) && !WORLDS.contains(&robot);
    (is_robot && !is_merger(robot)).then_some(robot)
}

/// The robot in the name of a frame that only a robot has.
fn robot_of_body(frame: &str) -> Option<&str> {
    BODIES.iter().find_map(|body| frame.strip_suffix(body)).filter(|robot| !robot.is_empty())
}

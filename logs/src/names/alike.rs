//! Logs that look alike are those of different robots.

use super::file_names::robot_names;
use super::{Input, NameError};
use crate::robots::{RobotChannels, Role};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The robot of each input: the one that was said, or the one that it is taken for because it looks like another. And what the
/// user should know of it.
pub(super) fn name(
    inputs: &[Input],
    channels: &[Vec<&Channel>],
    robots: &RobotTopics,
) -> Result<(Vec<Option<String>>, Option<String>), NameError> {
    let topics: Vec<BTreeSet<&str>> = channels.iter().map(|channels| robotless_topics(channels, robots)).collect();
    let is_like_another = |number: usize| {
        topics.iter().enumerate().any(|(other, topics_of)| other != number && !topics_of.is_disjoint(&topics[number]))
    };
    let alike: Vec<usize> = (0..inputs.len().min(topics.len()))
        .filter(|&number| inputs[number].robot.is_none() && is_like_another(number))
        .collect();
    let paths: Vec<PathBuf> = alike.iter().map(|&number| named_path(&inputs[number].path)).collect();
    let names = robot_names(&paths)?;
    let mut named: Vec<Option<String>> = inputs.iter().map(|input| input.robot.clone()).collect();
    for (&number, name) in alike.iter().zip(&names) {
        named[number] = Some(name.clone());
    }
    let remark = || {
        let taken: Vec<String> = alike
            .iter()
            .zip(&names)
            .map(|(&number, name)| format!("{} for {name}", inputs[number].path.display()))
            .collect();
        format!(
            "the logs look alike, and each is taken for a robot's: {}; ROBOT=LOG names them otherwise",
            taken.join(", ")
        )
    };
    let remark = (!alike.is_empty()).then(remark);
    Ok((named, remark))
}

/// The topics of a log by which robots are told apart, if none of them names a robot: `/map`, `/tf`, `/amcl_pose`.
fn robotless_topics<'a>(channels: &[&'a Channel], robots: &RobotTopics) -> BTreeSet<&'a str> {
    let roles = RobotChannels::new(robots.clone(), channels.iter().copied());
    let names_robot = |channel: &&Channel| {
        !matches!(roles.classify(channel).role, Role::Other | Role::Tf)
            || tf_topic(channel).is_some_and(|robot| !robot.is_empty())
    };
    if channels.iter().any(names_robot) {
        return BTreeSet::new();
    }
    let topics = channels.iter().filter(|channel| tells_of_a_robot(channel)).map(|channel| channel.topic.as_str());
    topics.collect()
}

/// Whether a channel has a type that a robot has one of: its map, its pose, its transforms, its scans.
fn tells_of_a_robot(channel: &Channel) -> bool {
    const TYPES: [&str; 6] = [
        OccupancyGrid::NAME,
        Odometry::NAME,
        PoseStamped::NAME,
        PoseWithCovarianceStamped::NAME,
        TagRange::NAME,
        "sensor_msgs/msg/LaserScan",
    ];
    TYPES.contains(&&*full_type_name(&channel.schema_name)) || tf_topic(channel).is_some()
}

/// The path that a log is called after: the folder of a bag rather than the description in it, and a file without the ending
/// that says how it is packed.
fn named_path(path: &Path) -> PathBuf {
    if path.file_name().is_some_and(|name| name == "metadata.yaml") {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        return folder.unwrap_or(Path::new(".")).to_owned();
    }
    match path.extension().is_some_and(|ending| ending == "zstd" || ending == "zst") {
        true => path.with_extension(""),
        false => path.to_owned(),
    }
}

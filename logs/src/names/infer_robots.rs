//! Inference of robot names: logs with the same topics, none of which contains a robot's name, are from different
//! robots.

use super::file_names::robot_names;
use super::{Input, NameError};
use crate::robots::{RobotChannels, Role, is_scan};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{OccupancyGrid, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The robot of each input: the one that the user gave, or the name of the file if another log has the same topics.
/// Also returns a note for the user about names that were inferred.
pub(super) fn infer_robots(
    inputs: &[Input],
    channels: &[Vec<&Channel>],
    robots: &RobotTopics,
) -> Result<(Vec<Option<String>>, Option<String>), NameError> {
    let topics: Vec<BTreeSet<&str>> = channels.iter().map(|channels| robotless_topics(channels, robots)).collect();
    let shares_topics = |number: usize| {
        topics.iter().enumerate().any(|(other, topics_of)| other != number && !topics_of.is_disjoint(&topics[number]))
    };
    let unnamed: Vec<usize> = (0..inputs.len().min(topics.len()))
        .filter(|&number| inputs[number].robot.is_none() && shares_topics(number))
        .collect();
    let paths: Vec<PathBuf> = unnamed.iter().map(|&number| named_path(&inputs[number].path)).collect();
    let names = robot_names(&paths)?;
    let mut named: Vec<Option<String>> = inputs.iter().map(|input| input.robot.clone()).collect();
    for (&number, name) in unnamed.iter().zip(&names) {
        named[number] = Some(name.clone());
    }
    let note = || {
        let taken: Vec<String> = unnamed
            .iter()
            .zip(&names)
            .map(|(&number, name)| format!("{} to {name}", inputs[number].path.display()))
            .collect();
        format!(
            "the logs have equal topics without robot names, so each is assigned to a robot: {}; ROBOT=LOG sets other names",
            taken.join(", ")
        )
    };
    let note = (!unnamed.is_empty()).then(note);
    Ok((named, note))
}

/// The topics that show that a log is one robot's, such as `/map`, `/tf` and `/amcl_pose`; empty if any topic contains
/// a robot's name.
fn robotless_topics<'a>(channels: &[&'a Channel], robots: &RobotTopics) -> BTreeSet<&'a str> {
    let roles = RobotChannels::new(robots.clone(), channels.iter().copied());
    let names_robot = |channel: &&Channel| {
        !matches!(roles.classify(channel).role, Role::Other | Role::Tf)
            || tf_topic(channel).is_some_and(|robot| !robot.is_empty())
    };
    if channels.iter().any(names_robot) {
        return BTreeSet::new();
    }
    let topics = channels.iter().filter(|channel| is_of_a_robot(channel)).map(|channel| channel.topic.as_str());
    topics.collect()
}

/// Whether a channel's type is one that a robot has one topic of: map, pose, transforms, scans.
fn is_of_a_robot(channel: &Channel) -> bool {
    const TYPES: [&str; 5] =
        [OccupancyGrid::NAME, Odometry::NAME, PoseStamped::NAME, PoseWithCovarianceStamped::NAME, TagRange::NAME];
    let type_name = full_type_name(&channel.schema_name);
    TYPES.contains(&&*type_name) || is_scan(&type_name) || tf_topic(channel).is_some()
}

/// The path that a log is named after: the folder of a bag instead of its description, and a compressed file without
/// the extension of the compression.
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

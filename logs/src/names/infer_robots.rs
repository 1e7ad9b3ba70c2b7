//! Inference of robot names: logs with the same topics, none of which contains a robot's name, are from different
//! robots.

use super::file_names::robot_names;
use super::shown_robots::ShownRobots;
use super::{Input, NameError};
use crate::robots::{RobotChannels, Role, is_scan};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{OccupancyGrid, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TagRange};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The robot of each input: the one that the user gave, the one that frames show, or the name of the file if another log
/// has the same topics. Also returns a note for the user about names that were inferred.
pub(super) fn infer_robots(
    inputs: &[Input],
    channels: &[Vec<&Channel>],
    robots: &RobotTopics,
    shown: &ShownRobots,
) -> Result<(Vec<Option<String>>, Option<String>), NameError> {
    let topics: Vec<BTreeSet<&str>> = channels
        .iter()
        .enumerate()
        .map(|(number, channels)| robotless_topics(channels, robots, shown.of_input(number).is_some()))
        .collect();
    let shares_topics = |number: usize| {
        topics.iter().enumerate().any(|(other, topics_of)| other != number && !topics_of.is_disjoint(&topics[number]))
    };
    let mut named: Vec<Option<String>> = inputs.iter().map(|input| input.robot.clone()).collect();
    let unnamed: Vec<usize> = (0..inputs.len().min(topics.len()))
        .filter(|&number| named[number].is_none() && (shown.of_input(number).is_some() || shares_topics(number)))
        .collect();
    let by_frames = |number: usize| shown.of_input(number).and_then(|robot| robot.name.clone());
    let by_file: Vec<usize> = unnamed.iter().copied().filter(|&number| by_frames(number).is_none()).collect();
    let paths: Vec<PathBuf> = by_file.iter().map(|&number| named_path(&inputs[number].path)).collect();
    for (&number, name) in by_file.iter().zip(robot_names(&paths)?) {
        named[number] = Some(name);
    }
    let (mut equal, mut notes) = (Vec::new(), Vec::new());
    for &number in &unnamed {
        named[number] = named[number].take().or_else(|| by_frames(number));
        let (path, name) = (inputs[number].path.display(), named[number].as_deref().unwrap_or_default());
        match shown.of_input(number) {
            Some(robot) => notes.push(format!(
                "{}: {path} is read as the log of one robot, {name}; ROBOT=LOG sets another name{}",
                robot.sentence, robot.otherwise
            )),
            None => equal.push(format!("{path} to {name}")),
        }
    }
    let equal = (!equal.is_empty()).then(|| {
        format!(
            "the logs have equal topics without robot names, so each is assigned to a robot: {}; ROBOT=LOG sets other names",
            list_in_words(equal)
        )
    });
    let notes = equal.into_iter().chain(notes).chain(shown.notes().map(str::to_owned));
    Ok((named, notes.reduce(|one, other| format!("{one}; {other}"))))
}

/// The topics that show that a log is one robot's, such as `/map`, `/tf` and `/amcl_pose`; empty if any topic contains
/// a robot's name, unless the log is known to be one robot's.
fn robotless_topics<'a>(channels: &[&'a Channel], robots: &RobotTopics, is_of_one: bool) -> BTreeSet<&'a str> {
    let roles = RobotChannels::new(robots.clone(), channels.iter().copied());
    let names_robot = |channel: &&Channel| {
        !matches!(roles.classify(channel).role, Role::Other | Role::Tf)
            || tf_topic(channel).is_some_and(|robot| !robot.is_empty())
    };
    if !is_of_one && channels.iter().any(names_robot) {
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

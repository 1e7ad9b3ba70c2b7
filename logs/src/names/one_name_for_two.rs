//! Two robots of one name in several logs, which would be taken for one.

use super::error::NameError;
use crate::reader::LogFile;
use crate::robots::{RobotChannels, Role};
use gridweave_runtime::message::Channel;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What a log has of a robot.
struct Recording<'a> {
    file: usize,
    /// Log times of the first and the last message of all its channels.
    span: [u64; 2],
    /// The topics of its maps and scans.
    topics: BTreeSet<&'a str>,
}

/// Checks that no two files have maps or scans of robots with one name at the same time: the logs of one robot follow each other.
/// `channels` are those of the files, with their numbers in these, and `input_of` is the number of the input of each file.
pub(super) fn check_robots<'a>(
    channels: impl Iterator<Item = (usize, u16, &'a Channel)>,
    roles: &RobotChannels,
    files: &[LogFile],
    input_of: &[usize],
) -> Result<(), NameError> {
    let mut recordings: BTreeMap<&str, BTreeMap<usize, Recording<'_>>> = BTreeMap::new();
    for (file, number, channel) in channels {
        let classified = roles.classify(channel);
        let Some((first, last)) = files.get(file).and_then(|log| log.span(number)) else { continue };
        if matches!(classified.role, Role::Tf | Role::Other) {
            continue;
        }
        let of_robot = recordings.entry(classified.robot).or_default();
        let new = || Recording { file, span: [first, last], topics: BTreeSet::new() };
        let recording = of_robot.entry(file).or_insert_with(new);
        recording.span = [recording.span[0].min(first), recording.span[1].max(last)];
        if matches!(classified.role, Role::Map | Role::Scan) {
            recording.topics.insert(&channel.topic);
        }
    }
    for (robot, recordings) in recordings {
        let recordings: Vec<Recording<'_>> = recordings.into_values().collect();
        for (number, one) in recordings.iter().enumerate() {
            let are_two = |other: &&Recording<'_>| {
                let are_parts = input_of.get(one.file) == input_of.get(other.file) && {
                    let name =
                        |recording: &Recording<'_>| files.get(recording.file).map(|log| without_digits(log.path()));
                    name(one) == name(other)
                };
                !one.topics.is_disjoint(&other.topics) && are_of_one_time(one.span, other.span, are_parts)
            };
            if let Some(other) = recordings[number + 1..].iter().find(are_two)
                && let [Some(one), Some(other)] = [files.get(one.file), files.get(other.file)]
            {
                let [one, other] = [one, other].map(|log| log.path().to_owned());
                return Err(NameError::OneNameForTwo { robot: robot.to_owned(), one, other });
            }
        }
    }
    Ok(())
}

/// The name of a file without digits, which is that of all parts of one recording (`bag_0.mcap`, `bag_1.mcap`).
fn without_digits(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.chars().filter(|char| !char.is_ascii_digit()).collect()
}

/// Whether two spans of time have half of the shorter one or more in common; of the longer one, where they may be parts of one
/// recording. Such parts overlap a little where one ends and the next begins, as messages that came together are not written in the
/// order of their times, and the last one may be as short as that.
fn are_of_one_time(one: [u64; 2], other: [u64; 2], are_parts: bool) -> bool {
    let [start, end] = [one[0].max(other[0]), one[1].min(other[1])];
    let lengths = [one, other].map(|[first, last]| last.saturating_sub(first));
    let length = if are_parts { lengths[0].max(lengths[1]) } else { lengths[0].min(lengths[1]) };
    end.checked_sub(start).is_some_and(|common| common >= length.div_ceil(2))
}
